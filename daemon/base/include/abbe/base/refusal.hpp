#pragma once
/// Converts between Error and the answer on the control socket.

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {

/// The Error that an answer with "ok": false reports. An unknown code, which a newer daemon may
/// send, becomes ErrorCode::Refused.
[[nodiscard]] Error error_of_refusal(const nlohmann::json& answer);

/// "data_insufficient", "io" ...: the value of "code" in an answer.
[[nodiscard]] std::string_view code_name(ErrorCode code) noexcept;

}  // namespace abbe::daemon
