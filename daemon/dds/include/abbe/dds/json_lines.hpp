#pragma once
/// Formats a sample as one line with a JSON object, for programs that read the output of
/// abbe-watch: "topic" and every field of the IDL by its name. NaN becomes null. Pure, thread-safe.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::dds {

/// Without the newline. Error BadInput: the payload does not decode.
[[nodiscard]] daemon::Result<std::string> json_line(daemon::Topic topic,
                                                    std::span<const std::byte> payload);

}  // namespace abbe::dds
