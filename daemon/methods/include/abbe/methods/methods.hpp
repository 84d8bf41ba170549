#pragma once
/// The calibration methods of this build, one line each. docs/adding_a_method.md describes how to
/// add a method.

#include "abbe/methods/evemu/method.hpp"
#include "abbe/methods/method_list.hpp"
#include "abbe/methods/mfb/method.hpp"
#include "abbe/methods/otf/method.hpp"

namespace abbe::daemon {

using Methods = MethodList<OtfMethod,    // calibration on the fly, with a laser tracker
                           EvemuMethod,  // touches of a ball array
                           MfbMethod>;   // touches of a Multi-Feature Bar

}  // namespace abbe::daemon
