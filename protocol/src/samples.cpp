// Compiles the header, so that its static assertions are checked in every build.
#include "abbe/protocol/samples.hpp"
#include "abbe/protocol/rt.hpp"
