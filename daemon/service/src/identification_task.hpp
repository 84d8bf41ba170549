#pragma once
/// The background task of a complete run: identifies the model, judges it, stores it, activates it
/// if the gate accepted it, and encodes what is published of it. Its result reaches the hub once.

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "abbe/base/wall_clock.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/calibration_session.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "abbe/service/model_keeper.hpp"

namespace abbe::daemon {

/// An identified model with its verdict. Not changed while it is stored, except `discarded`.
struct JudgedModel {
  std::string id;
  ModelDocument document;
  calib::Verdict verdict;
  StoreActor actor;
  KeptBeside beside{};  ///< drift of the active model; the run alone, if `document` is an update
  std::atomic<bool> discarded{false};  ///< the session was cancelled: do not store the model
};

/// Shared by the hub's thread and the task of an identification, which may outlive the
/// CalibrationService. The state of the calibration is in CalibrationSession, to which the hub's
/// thread reports what the task has reached.
class IdentificationLink {
 public:
  std::atomic<double> share{0.0};  ///< progress of the identification, 0 to 1
  std::atomic<bool> stopped{false};
  std::atomic<protocol::HostTime> now{};  ///< time of the hub's latest cycle

  /// For the task, before it stores the model: afterwards no cancel() can discard the model. False
  /// if the model is already discarded.
  [[nodiscard]] bool begin_storing(std::shared_ptr<JudgedModel> model) {
    model_ = std::move(model);
    auto first = First::Neither;
    // release: pairs with the acquire in take_model()
    if (first_.compare_exchange_strong(first, First::Storing, std::memory_order_release))
      return true;
    model_ = nullptr;  // here, because the hub's thread must not free a model
    return false;
  }
  /// For the hub: the model will not be stored when its identification ends. False if it is already
  /// being stored.
  [[nodiscard]] bool discard() noexcept {
    auto first = First::Neither;
    return first_.compare_exchange_strong(first, First::Discarded) || first == First::Discarded;
  }
  /// For the hub: returns the model, once, after begin_storing() returned true; before that null.
  [[nodiscard]] std::shared_ptr<JudgedModel> take_model() noexcept {
    // acquire: pairs with the release in begin_storing()
    if (first_.load(std::memory_order_acquire) != First::Storing) return nullptr;
    return std::exchange(model_, nullptr);
  }

 private:
  /// Which of begin_storing() and discard() came first; decided once.
  enum class First : std::uint8_t { Neither, Storing, Discarded };
  std::atomic<First> first_{First::Neither};
  // owned by the task before begin_storing(), then by the hub
  std::shared_ptr<JudgedModel> model_;
};

/// Run it once, on an ordinary thread.
struct IdentificationTask {
  std::shared_ptr<IdentificationLink> link;
  std::shared_ptr<const Config> config;
  Acquisition acquired;
  std::shared_ptr<const PublishedModel> active;  ///< the gate compares with it; may be null
  bool active_left_out = false;         ///< the active model is for another machine configuration
  std::future<RecordingDigest> digest;  ///< invalid: nothing is recorded
  ModelKeeper keeper;
  WallClock clock;
  std::string who;

  /// An error before begin_storing() means that no model was identified; an error after it means
  /// that the model could not be stored.
  [[nodiscard]] Result<KeptModel> operator()();

 private:
  [[nodiscard]] Result<std::shared_ptr<JudgedModel>> judged_model();
  void add_notes(JudgedModel& model) const;
  void compare_with_active(JudgedModel& model, const CalibrationRun& run) const;
};

}  // namespace abbe::daemon
