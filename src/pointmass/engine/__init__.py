"""What takes a system from one step to the next: the reference path in NumPy, for any Python force."""
