"""One thread inside, as many as before outside."""

import numpy as np
import pytest

from runs.threads import _libraries, one_blas_thread


def test_threads_come_back_whatever_happens_inside() -> None:
    np.ones((4, 4)) @ np.ones(4)  # the library is loaded
    found = _libraries()
    if not found:
        pytest.skip("no OpenBLAS here")
    (setter, getter), before = found[0], found[0][1]()
    setter(2)
    try:
        with one_blas_thread():
            assert getter() == 1
            with one_blas_thread():
                assert getter() == 1
            assert getter() == 1
        assert getter() == 2
        with pytest.raises(ZeroDivisionError), one_blas_thread():
            raise ZeroDivisionError
        assert getter() == 2
    finally:
        setter(before)
