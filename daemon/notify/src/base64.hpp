#pragma once

#include <string>
#include <string_view>

namespace abbe::notify {

/// The bytes in Base64 [RFC 4648, 4], without line ends.
[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace abbe::notify
