#pragma once
/// The outcome of a request to stop the measuring machine, as the daemon reports it.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// `stop`: the member "stop" of an answer. Returns the sentence of the outcome. If the machine may
/// still be moving, returns an Error (StopNotConfirmed, StopNotSent).
[[nodiscard]] Result<std::string> stop_outcome(const nlohmann::json& stop);

/// Waits for the outcome of the request with this number. StopNotConfirmed if the daemon does not
/// answer any more, does not know the request (it has restarted), or has no outcome after 10 s.
[[nodiscard]] Result<std::string> await_stop(const std::filesystem::path& socket,
                                             std::uint64_t number);

}  // namespace abbe::daemon
