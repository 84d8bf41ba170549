// Nothing of its own: the target that carries the precompiled headers of all test programs needs
// one source.
