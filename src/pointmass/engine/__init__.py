"""What takes a system from one step to the next. Here the reference path: NumPy, the lecture's loop, any Python
force."""
