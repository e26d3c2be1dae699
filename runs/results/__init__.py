"""Result folders for people and programs: reader, info, export, .tir files."""
