#pragma once
/// The machine of most tests, as a file would describe it.

namespace abbe::daemon::test {

inline constexpr const char* kMill = R"([machine]
name = "mill"
chain = "[w X' b Y Z (C1) t]"
[axes.X]
min_mm = -300
max_mm = 300
[axes.Y]
min_mm = -250
max_mm = 250
[axes.Z]
min_mm = -400
max_mm = -100
[target]
offset_mm = [20, -15, -120]
[model]
node_spacing_mm = 50
)";

}  // namespace abbe::daemon::test
