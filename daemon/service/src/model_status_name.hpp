#pragma once

#include <string_view>

#include "abbe/publishing/publisher.hpp"

namespace abbe::daemon {

/// The name of the status for people and programs.
inline std::string_view status_name(v1::ModelStatus status) {
  switch (status) {
    case v1::ModelStatus::MODEL_NONE:
      return "NONE";
    case v1::ModelStatus::MODEL_ACTIVE:
      return "ACTIVE";
    case v1::ModelStatus::MODEL_STALE:
      return "STALE";
    case v1::ModelStatus::MODEL_DRIFT:
      return "DRIFT";
    case v1::ModelStatus::MODEL_INVALID:
      return "INVALID";
  }

  return "INVALID";
}

}  // namespace abbe::daemon
