#pragma once
/// `abbe reference` in the daemon: runs a ReferenceSession with the live samples and the reference
/// marks of the second card, and keeps the zero of every axis. The hub's thread only; no call
/// waits.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/counting_state.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "abbe/recording/recorder_thread.hpp"

namespace abbe::daemon {

class ReferenceService : public PipelineObserver {
 public:
  struct AxisStatus {
    std::string name;
    AxisReference found;           ///< result of the running or latest session
    double reading_at_zero = 0.0;  ///< reading at count 0 in state Found, m or rad
    bool known = false;            ///< the axis is referenced now
  };

  /// `recorder` may be null. `left`: counters and zeros at the end of the previous run. They are
  /// used if the first sample shows that the counters have continued since, else discarded.
  ReferenceService(const Config& config, RecorderThread* recorder,
                   std::optional<Counting> left = {});

  /// Starts a search for the reference marks. Refused if no card latches at marks, and while a
  /// search is running. A referenced axis keeps its zero until the new one is found.
  [[nodiscard]] Result<void> start();
  [[nodiscard]] Result<void> cancel();
  /// Sets the zero of axes without marks such that their present readings become their configured
  /// offsets. Usage for an axis that has marks or is not counted, and for an uncertainty that is
  /// not positive. Refused while a calibration takes readings, without a recent sample, and unless
  /// the axes have stood for half a second.
  [[nodiscard]] Result<void> set_zero_here(const SetZeroHere& here);
  /// Passes the samples of the batch to the search while one is running.
  void on_delivered(const Batch& batch) override;
  /// The zero of every axis, for the pipeline.
  [[nodiscard]] AxisZeros& zeros() noexcept { return zeros_; }
  /// Takes the latest state of the card's counters, as the devices report it. Call it after
  /// on_delivered().
  void take(const std::optional<CountingProgress>& progress);

  /// State of the counters and zeros, to be kept for the next run of abbed. nullopt after a
  /// restart of the counters until the card has reported their state.
  [[nodiscard]] std::optional<Counting> counting() const;
  /// Names of the axes whose zero was taken over from the previous run.
  [[nodiscard]] const std::vector<std::string>& carried_on() const noexcept { return carried_on_; }
  [[nodiscard]] bool configured() const noexcept { return marks_ != nullptr; }
  [[nodiscard]] bool running() const noexcept { return running_; }
  [[nodiscard]] std::vector<AxisStatus> status() const;
  /// Names of the axes of the counter card that are not referenced now.
  [[nodiscard]] std::vector<std::string> unknown() const;
  /// Names of the axes in unknown() that have no reference marks.
  [[nodiscard]] std::vector<std::string> without_zero() const;

 private:
  void look_for_marks(const Batch& batch);
  void use_zero(std::size_t axis);
  void use_zero(const FoundZero& zero);
  [[nodiscard]] std::vector<std::string> without_marks() const;
  void watch_standing(const protocol::AxisSample& sample);
  void use_zeros_left(const protocol::AxisSample& first);
  [[nodiscard]] Result<void> check_standing(std::size_t axis) const;
  [[nodiscard]] double reading_at_zero(std::size_t axis) const;

  const Config& config_;
  std::optional<CountedAxes> counted_;
  const ReferenceMarks* marks_;
  RecorderThread* recorder_;
  AxisZeros zeros_;
  std::optional<ReferenceSession> session_;  ///< the latest search
  std::vector<bool> zero_used_;
  bool running_ = false;
  struct Standing {
    std::int64_t count = 0;
    protocol::HostTime since{};
  };
  /// duration of standstill of each axis, in the order of the counted axes
  std::vector<Standing> standing_;
  protocol::HostTime newest_{};  ///< time of the newest live sample
  std::optional<protocol::AxisSample> latest_;
  protocol::HostTime from_{};  ///< start of the search: only later marks are used
  std::optional<Counting> left_;
  std::vector<std::string> carried_on_;
  protocol::HostTime restarted_at_{};       ///< time of the sample that showed a counter restart
  std::optional<CountingProgress> coming_;  ///< state that is newer than the newest sample
  std::optional<CountingProgress> progress_;
};

}  // namespace abbe::daemon
