#pragma once

#include "abbe/calib/evemu/lack_of_fit.hpp"

namespace abbe::calib::evemu {

[[nodiscard]] inline Result<void> check_stopped(const Watch& watch) {
  if (watch.stopped && watch.stopped()) {
    return failure(ErrorCode::NotConverged, "identification: stopped before its end");
  }
  return {};
}

}  // namespace abbe::calib::evemu
