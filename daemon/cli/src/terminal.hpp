#pragma once
/// What may be written where: colour and progress are for people at a terminal, never for files and
/// pipes.

#include <chrono>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// A terminal that shows colours, and nobody set NO_COLOR (no-color.org).
[[nodiscard]] bool shows_colour(int fd);

inline constexpr int kRed = 1, kGreen = 2, kYellow = 3;  // as ANSI counts colours

/// `text` in a colour, or plain where the terminal would show it as garbage.
[[nodiscard]] std::string coloured(std::string_view text, int colour, int fd);

/// "abbe: error: ..." and the details, one a line, on stderr; returns the exit code.
int report(const Error& error);

/// A bar on stderr, redrawn when its percentage changes; silent unless stderr is a terminal. Erases
/// itself.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted = true);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() { clear(); }

  void show(std::string_view step, double fraction);
  void clear();

 private:
  bool active_;
  std::string step_;
  int percent_ = -1;
};

}  // namespace abbe::daemon
