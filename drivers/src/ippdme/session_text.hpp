#pragma once
/// Texts of the session: commands for the server, and messages about errors of the server.

#include <string>
#include <string_view>

#include "abbe/drivers/ippdme/session.hpp"

namespace abbe::drivers::ipp_text {

inline constexpr int kRepairable = 2;  ///< severity: from this value on the command has failed
inline constexpr int kUserNeeded = 3;  ///< severity: from this value on a motion is aborted
inline constexpr int kAborted = 6;     ///< code: the command was ended by AbortE
/// Error code with which StartSession is refused while another session has not ended.
inline constexpr int kProtocolError = 8;

[[nodiscard]] double seconds(std::chrono::nanoseconds d);
/// Text in which every byte outside of printable ASCII is replaced by its value, as \\xE4.
[[nodiscard]] std::string escaped(std::string_view text);
/// Text such as "1006 Surface not found (severity 2)".
[[nodiscard]] std::string text_of(const IppError& error);
[[nodiscard]] std::string_view method_name(std::string_view method);
/// An error if a number of the point cannot be written.
[[nodiscard]] Result<std::string> go_to(const ProbePoint& point);
[[nodiscard]] Result<std::string> pt_meas(const ProbePoint& point);

}  // namespace abbe::drivers::ipp_text
