"""Laws: families of forces, and the loops of the reference path.

A law is written once, as a function of numbers, and traced (`pointmass.tracing`); the NumPy columns, the exact Jacobian
and the compiled kernels are printed from its program. Families differ in what they couple: `unary` one particle,
`elements` a few, `pairs` every two; `arrays` takes any NumPy function.
"""
