#pragma once
/// The simulated measuring machine on its port.

#include "abbe/sim/controller_server.hpp"
#include "abbe/sim/ippdme_device.hpp"

namespace abbe::sim {

using IppDmeServer = ControllerServer<IppDmeDevice>;

}  // namespace abbe::sim
