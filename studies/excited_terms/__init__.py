"""Does PySINDy name the terms that act, and none that do not?"""
