#include "terminal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "abbe/base/printable.hpp"

namespace abbe::daemon {

namespace {

std::string_view environment(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? std::string_view{value} : std::string_view{};
}

}  // namespace

bool shows_colour(int fd) {
  return ::isatty(fd) == 1 && environment("NO_COLOR").empty() && environment("TERM") != "dumb";
}

std::string coloured(std::string_view text, int colour, int fd) {
  return shows_colour(fd) ? fmt::format("\x1b[3{}m{}\x1b[0m", colour, text) : std::string{text};
}

int report(const Error& error) {
  fmt::print(stderr, "abbe: {} {}\n", coloured("error:", kRed, STDERR_FILENO),
             printable(error.text));
  for (const auto& line : error.details) fmt::print(stderr, "  {}\n", printable(line));
  return exit_code(error.code);
}

ProgressBar::ProgressBar(bool wanted) : active_(wanted && ::isatty(STDERR_FILENO) == 1) {}

void ProgressBar::show(std::string_view step, double fraction) {
  constexpr int kWidth = 30;
  const int percent = static_cast<int>(100.0 * std::clamp(fraction, 0.0, 1.0));
  if (!active_ || (percent == percent_ && step == step_)) return;
  percent_ = percent;
  step_ = step;
  const auto filled = static_cast<std::size_t>(percent * kWidth / 100);
  fmt::print(stderr, "\r\x1b[K{:<22} [{:-<{}}] {:3} %", step, std::string(filled, '#'), kWidth,
             percent);
  std::fflush(stderr);
}

void ProgressBar::clear() {
  if (active_ && percent_ >= 0) fmt::print(stderr, "\r\x1b[K");
  percent_ = -1;
}

}  // namespace abbe::daemon
