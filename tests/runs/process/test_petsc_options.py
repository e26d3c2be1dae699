"""Options of PETSc that nothing reads are told."""

from tireroad.runs import pipeline


def test_options_that_petsc_did_not_read_are_told(monkeypatch) -> None:
    from petsc4py import PETSc

    told = []
    monkeypatch.setattr(pipeline.console, "warn", told.append)
    options = PETSc.Options()
    options["made_up_read"], options["made_up_unread"] = 3, 4
    assert options.getInt("made_up_read") == 3
    pipeline._check_options(["-made_up_read", "3", "-made_up_unread", "4"])
    assert told == ["PETSc options that nothing read: -made_up_unread"]
    pipeline._check_options(["-made_up_unread", "4"], ["modes"])
    assert told[1].endswith("reused stages read none (modes): --fresh")
    for name in ("made_up_read", "made_up_unread"):
        options.delValue(name)
