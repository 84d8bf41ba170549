#pragma once
/// The progress that a task reports.

#include <functional>
#include <string_view>
#include <utility>

namespace abbe::daemon {

/// Receives the step that is under way and its share, 0 to 1. A task calls it from the thread that
/// runs the task. Without a function nothing is shown.
class Progress {
 public:
  using Show = std::function<void(std::string_view step, double share)>;

  Progress() = default;
  explicit Progress(Show show) : show_(std::move(show)) {}

  void show(std::string_view step, double share) const {
    if (show_) show_(step, share);
  }

 private:
  Show show_;
};

}  // namespace abbe::daemon
