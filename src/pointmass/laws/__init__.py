"""Laws: families of forces, the tracer that turns a law into a program, and the loops of the reference path.

A law is written once, as a function of numbers. It is called once on symbols (`trace`), which record a straight-line
`program`; the NumPy columns, the exact Jacobian and the compiled kernels are printed from that. Families differ in what
they couple: `unary` one particle, `elements` a few, `pairs` every two; `arrays` takes any NumPy function.
"""
