#pragma once
/// Formats a sample as one line with a JSON object, for programs that read the output of
/// abbe-watch: "topic" and every field of the IDL by its name. NaN becomes null. Pure, thread-safe.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::dds {

/// The line of one sample, without the newline. Error BadInput if the payload cannot be decoded.
[[nodiscard]] daemon::Result<std::string> json_line(daemon::Topic topic,
                                                    std::span<const std::byte> payload);

}  // namespace abbe::dds
