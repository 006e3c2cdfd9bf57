"""The tracer: a law is called once on symbols, and the straight-line program that it records is printed from there.

`trace` calls the law, `program` is what it becomes, `columns` prints that as NumPy, `derivative` differentiates it,
`functions` and `elementary` are what laws may call.
"""
