#pragma once
/// Converts between Error and the answer on the control socket.

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {

/// `answer` has "ok": false. An unknown code (from a newer daemon) becomes ErrorCode::Refused.
[[nodiscard]] Error error_of_refusal(const nlohmann::json& answer);

/// "data_insufficient", "io" ...: the value of "code" in an answer.
[[nodiscard]] std::string_view code_name(ErrorCode code) noexcept;

}  // namespace abbe::daemon
