#pragma once
/// An Error as the answer on the control socket, and back.

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {

/// `answer`: with "ok": false. A code nobody knows, of a newer daemon, is Refused.
[[nodiscard]] Error error_of_refusal(const nlohmann::json& answer);

/// "data_insufficient", "io" ...: what a program acts on.
[[nodiscard]] std::string_view word_of(ErrorCode code) noexcept;

}  // namespace abbe::daemon
