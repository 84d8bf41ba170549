#pragma once
/// Output to the user. Colour and progress are written to a terminal only, never to files and
/// pipes.

#include <chrono>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// True if `fd` is a terminal with colours and NO_COLOR (no-color.org) is not set.
[[nodiscard]] bool shows_colour(int fd);

inline constexpr int kRed = 1, kGreen = 2, kYellow = 3;  // ANSI colour numbers

/// `text` in a colour, or unchanged if shows_colour(fd) is false.
[[nodiscard]] std::string coloured(std::string_view text, int colour, int fd);

/// Prints "abbe: error: ..." and the details, one per line, to stderr; returns the exit code.
int report(const Error& error);

/// A progress bar on stderr, redrawn when its percentage changes. Prints nothing unless stderr is a
/// terminal. The destructor erases the bar.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted = true);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() { clear(); }

  void show(std::string_view step, double fraction);
  /// Shows the progress that a task reports; the bar must outlive the task.
  [[nodiscard]] Progress progress(Progress::Stopped stopped = {}) {
    return Progress([this](std::string_view step, double share) { show(step, share); },
                    std::move(stopped));
  }
  void clear();

 private:
  bool active_;
  std::string step_;
  int percent_ = -1;
};

}  // namespace abbe::daemon
