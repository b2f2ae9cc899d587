"""Laws and triggers of other packages and files, which compiled code calls as C functions.

A plug-in is a class: a model of its parameters, with the `STATE` that it keeps, and a function. The
function is compiled Python, plain Python or a shared library; to the compiled step each is the
address of a C function with the interface of `ftc_law.h` or `ftc_trigger.h` beside this file, so
that nothing of ours is compiled again for it.
"""
