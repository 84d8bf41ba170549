#include "abbe/base/local_time.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <ctime>

#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {

std::string local_time_text(protocol::UtcTime time) {
  constexpr std::size_t kSeconds = 19;  // "2024-05-17T08:30:00"
  std::string utc = to_text(time).substr(0, kSeconds) + "Z";
  const std::time_t seconds =
      std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  std::tm local{};
  // The call is necessary because localtime_r() need not read TZ.
  static const bool zone_is_read = (::tzset(), true);
  if (!zone_is_read || ::localtime_r(&seconds, &local) == nullptr || local.tm_gmtoff == 0)
    return utc;
  std::array<char, 64> text{};
  if (std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S %z", &local) == 0) return utc;
  return fmt::format("{} ({})", text.data(), utc);
}

}  // namespace abbe::daemon
