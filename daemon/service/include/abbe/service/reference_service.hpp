#pragma once
/// `abbe reference` in the daemon: runs a ReferenceSession over the live samples and the marks of
/// the second card, and gives every reading its datum. The hub's thread only; no call waits for
/// anything.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/pipeline/counting_state.hpp"
#include "abbe/pipeline/datum.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "abbe/recording/recorder_thread.hpp"

namespace abbe::daemon {

class ReferenceService : public PipelineObserver {
 public:
  struct AxisStatus {
    std::string name;
    AxisReference found;           ///< of the running session, or of the latest
    double reading_at_zero = 0.0;  ///< with state Found: m or rad, what the datum says of count 0
    bool known = false;            ///< readings have a datum now
  };

  /// `recorder` may be null. `left`: the datum of an earlier run, taken up if the first sample
  /// shows that the counters went on, else dropped.
  ReferenceService(const Config& config, RecorderThread* recorder,
                   std::optional<Counting> left = {});

  /// Refused without [reference] and while one runs. Axes that are known already stay so until the
  /// new datum.
  [[nodiscard]] Result<void> start();
  [[nodiscard]] Result<void> cancel();
  /// Usage for an axis that has marks or is not counted, and for an uncertainty that is not
  /// positive. Refused while a calibration takes readings, without a fresh sample, and unless the
  /// axes have stood for half a second.
  [[nodiscard]] Result<void> set_datum_here(const SetDatumHere& here);
  /// Searches the marks while a search is running.
  void on_delivered(const Batch& batch) override;
  /// The datum of every axis, for the pipeline.
  [[nodiscard]] Datum& datum() noexcept { return datum_; }
  /// After on_delivered(): the progress of the card, as the devices report it.
  void take(const std::optional<drivers::CounterCardProgress>& progress);

  /// What a later run would have to know; nothing while the counters just began anew.
  [[nodiscard]] std::optional<Counting> counting() const;
  /// Axes whose datum of an earlier run was taken up.
  [[nodiscard]] const std::vector<std::string>& carried_on() const noexcept { return carried_on_; }
  [[nodiscard]] bool configured() const noexcept { return config_.reference.has_value(); }
  [[nodiscard]] bool running() const noexcept { return running_; }
  [[nodiscard]] std::vector<AxisStatus> status() const;
  /// Axes of the counter card whose readings have no datum now.
  [[nodiscard]] std::vector<std::string> unknown() const;
  /// Those of them without marks.
  [[nodiscard]] std::vector<std::string> without_zero() const;

 private:
  void look_for_marks(const Batch& batch);
  void take_up(std::size_t axis);
  void take_up(const FoundDatum& datum);
  [[nodiscard]] std::vector<std::string> without_marks() const;
  void watch_standing(const protocol::AxisSample& sample);
  void take_up_left(const protocol::AxisSample& first);
  [[nodiscard]] Result<void> check_standing(std::size_t axis) const;
  [[nodiscard]] double reading_at_zero(std::size_t axis) const;

  const Config& config_;
  RecorderThread* recorder_;
  Datum datum_;
  std::optional<ReferenceSession> session_;  ///< the latest
  std::vector<bool> taken_up_;
  bool running_ = false;
  struct Standing {
    std::int64_t count = 0;
    protocol::HostTime since{};
  };
  std::vector<Standing> standing_;  ///< as the axes of [counter_card]
  protocol::HostTime newest_{};     ///< of the live samples
  std::optional<protocol::AxisSample> latest_;
  protocol::HostTime from_{};  ///< what came later belongs to the search
  std::optional<Counting> left_;
  std::vector<std::string> carried_on_;
  protocol::HostTime restarted_at_{};  ///< the counters; of the sample that showed it
  std::optional<drivers::CounterCardProgress> coming_;  ///< later than the newest sample
  std::optional<drivers::CounterCardProgress> progress_;
};

}  // namespace abbe::daemon
