#pragma once
/// Reports the progress of a task, and signals the task when to stop.

#include <functional>
#include <string_view>
#include <utility>

namespace abbe::daemon {

/// Receives the present step and the fraction of it that is done, 0 to 1, and states whether the
/// task must stop. A task calls it from the thread that runs the task. Without functions, nothing
/// is shown and no task is stopped.
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
  /// True: the task must stop. A task that supports this soon returns an Error, or the result found
  /// so far. Once true, the value must stay true.
  [[nodiscard]] bool stopped() const { return stopped_ && stopped_(); }

 private:
  Show show_;
  Stopped stopped_;
};

}  // namespace abbe::daemon
