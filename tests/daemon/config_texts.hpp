#pragma once
/// Pieces of configurations that several tests read.

namespace abbe::daemon::test {

/// Of [Li OMM]: base, Z, X, Y, probe.
inline constexpr const char* kWeakPortal = R"([machine]
name = "weak portal"
chain = "[w b Z X Y t]"
[axes.X]
min_mm = -100
max_mm = 650
[axes.Y]
min_mm = -100
max_mm = 400
[axes.Z]
min_mm = 0
max_mm = 100
)";

/// 500 mm each way; its counter card comes after it.
inline constexpr const char* kHalfMetreMill = R"([machine]
name = "mill"
chain = "[w X' b Y Z (C1) t]"
[axes.X]
min_mm = 0
max_mm = 500
[axes.Y]
min_mm = 0
max_mm = 500
[axes.Z]
min_mm = 0
max_mm = 500
[target]
offset_mm = [0, 0, 0]
)";

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
