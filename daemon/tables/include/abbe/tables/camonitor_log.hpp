#pragma once
/// Logs of `camonitor` of EPICS Base: one line for each update of a process variable (PV), with the
/// time of the server in the time zone of the computer that printed it. Only time differences are
/// used, so the zone has no effect. Faults as in input_files.hpp.

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

struct CamonitorOptions {
  std::array<std::string, 3> pvs;  ///< names of the PVs of X, Y, Z
  double metres_per_value = 0.0;
};

/// True if the first line is one of camonitor: a name, then a date with a time or "***".
[[nodiscard]] bool is_camonitor_log(std::string_view text);

/// Names of the PVs in the text, in the order of their first occurrence; at most `most`.
[[nodiscard]] std::vector<std::string> pvs_of_log(std::string_view text, std::size_t most);

/// The scale readings of the three axes. The axes have updates at different times: there is a row
/// at every update of an axis at which the other two are known. The position of an axis is known at
/// its updates. Between two updates at most 1.5 median intervals apart it is interpolated linearly.
/// Between two updates further apart the axis has the position of the first one until 1.5 median
/// intervals before the second.
///
/// Faults are lines of another format (relative or client times, another separator), an axis that
/// was disconnected, has no value, an INVALID one, or two at one time, times that go back, values
/// with so few digits that a step is above 1 um.
[[nodiscard]] Result<EncoderFile> parse_camonitor_log(std::string_view text,
                                                      const std::filesystem::path& file,
                                                      const CamonitorOptions& options);

}  // namespace abbe::daemon
