#pragma once
/// Collects the faults of an input file and converts them to an Error of the daemon.

#include "abbe/base/error.hpp"
#include "abbe/protocol/table/faults.hpp"

namespace abbe::daemon {

using protocol::edit_distance;
using protocol::nearest;
using protocol::suggestion;

class Faults : public protocol::Faults {
 public:
  using protocol::Faults::Faults;
  [[nodiscard]] Error to_error() const {  ///< code BadInput; requires any()
    return {ErrorCode::BadInput, heading(), lines()};
  }
};

}  // namespace abbe::daemon
