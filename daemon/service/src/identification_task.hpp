#pragma once
/// The background task of a complete run. It identifies the model, judges it, stores it, activates
/// it if the gate accepted it, and encodes the messages for publication. Its result is passed to
/// the hub once.

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

/// An identified model with its verdict. While it is stored, only `discarded` may change.
struct JudgedModel {
  std::string id;
  ModelDocument document;
  calib::Verdict verdict;
  StoreActor actor;
  /// drift of the active model; and, if `document` is an update, the model of the run alone
  KeptBeside beside{};
  std::atomic<bool> discarded{false};  ///< the session was cancelled: do not store the model
};

/// Data shared by the hub's thread and the task of an identification, which may outlive the
/// CalibrationService. The hub's thread reports the progress of the task to CalibrationSession,
/// which holds the state of the calibration.
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
    model_ = nullptr;  // freed here, because the hub's thread must not free a model
    return false;
  }
  /// For the hub: discards the model, so that it is not stored when its identification ends. False
  /// if it is already being stored.
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
  /// The function that was called first, begin_storing() or discard(). It is decided once.
  enum class First : std::uint8_t { Neither, Storing, Discarded };
  std::atomic<First> first_{First::Neither};
  // belongs to the task before begin_storing(), then to the hub
  std::shared_ptr<JudgedModel> model_;
};

/// Call operator() once, on an ordinary thread.
struct IdentificationTask {
  std::shared_ptr<IdentificationLink> link;
  std::shared_ptr<const Config> config;
  Acquisition acquired;
  /// the model with which the gate compares; may be null
  std::shared_ptr<const PublishedModel> active;
  bool active_left_out = false;         ///< the active model is for another machine configuration
  std::future<RecordingDigest> digest;  ///< invalid: the run is not recorded
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
