// Empty: the target with the precompiled headers of all test programs needs one source file.
