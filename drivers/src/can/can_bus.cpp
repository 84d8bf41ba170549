#include "abbe/drivers/can/can_bus.hpp"

namespace abbe::drivers {

Result<void> CanBus::start_sync(std::chrono::nanoseconds) {
  return tl::unexpected(
      Error{ErrorCode::BadConfiguration,
            "CAN " + name() + ": cyclic transmission of the SYNC needs SocketCAN"});
}

}  // namespace abbe::drivers
