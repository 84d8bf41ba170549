#pragma once

#include "abbe/calib/error.hpp"
#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

[[nodiscard]] inline Result<void> check_stopped(const Options& options) {
  if (options.stopped && options.stopped()) {
    return failure(ErrorCode::NotConverged, "identification: stopped before its end");
  }
  return {};
}

}  // namespace abbe::calib::otf
