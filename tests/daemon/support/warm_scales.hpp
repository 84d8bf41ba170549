#pragma once

namespace abbe::daemon::test {

/// Encoders, and the temperature of the scale of X.
inline constexpr const char* kWarmScales = R"([encoder]
transport = "udp"
peer_host = "10.0.0.8"
peer_port = 20000
nodes = [{axis = "X", node = 1}, {axis = "Y", node = 2}, {axis = "Z", node = 3}]
[[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
serial = "/dev/serial/by-id/rs485"
inputs = ["scale_x"]
[[thermal]]
axis = "X"
temperature = "scale_x"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 0.5
u_temperature_K = 0.2
fixed_mm = 0
)";

}  // namespace abbe::daemon::test
