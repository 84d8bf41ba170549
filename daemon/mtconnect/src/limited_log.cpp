#include "abbe/mtconnect/limited_log.hpp"

#include <fmt/format.h>

namespace abbe::mtconnect {

void LimitedLog::line(std::string_view text, Clock::time_point now) {
  if (now - began_ >= kPeriod) {
    began_ = now;
    written_ = 0;
  }
  if (written_ >= kLines) {
    ++omitted_;
    return;
  }

  if (const auto omitted = std::exchange(omitted_, 0); omitted > 0)
    write_(fmt::format("{} lines before this one were not logged", omitted));
  write_(text);
  ++written_;
}

}  // namespace abbe::mtconnect
