#pragma once
/// httplib without the macro _res of resolv.h, which changes headers of Eigen that come later.

#include <httplib.h>

#undef _res
