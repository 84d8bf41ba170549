#pragma once

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Calls Options::progress if there is one. `fraction`: 0 to 1 of the stage.
inline void report(const Options& options, Stage stage, double fraction) {
  if (options.progress) {
    options.progress(stage, fraction);
  }
}

}  // namespace abbe::calib::otf
