#pragma once
/// The progress that a task reports, and the wish to stop it.

#include <functional>
#include <string_view>
#include <utility>

namespace abbe::daemon {

/// Receives the step that is under way and its share, 0 to 1, and states whether the task is to
/// stop. A task calls it from the thread that runs the task. Without functions nothing is shown and
/// no task is stopped.
class Progress {
 public:
  using Show = std::function<void(std::string_view step, double share)>;
  using Stopped = std::function<bool()>;

  Progress() = default;
  explicit Progress(Show show, Stopped stopped = {})
      : show_(std::move(show)), stopped_(std::move(stopped)) {}

  void show(std::string_view step, double share) const {
    if (show_) show_(step, share);
  }
  /// True: a task that says so returns an Error soon, or what it has found so far. Once true, it
  /// must stay true.
  [[nodiscard]] bool stopped() const { return stopped_ && stopped_(); }

 private:
  Show show_;
  Stopped stopped_;
};

}  // namespace abbe::daemon
