#pragma once
/// Adds models to the store, and changes which one is active, for clients that may not write to it.
/// A change runs on an ordinary thread, because the store's lock may be held by another process: a
/// request, for example a stop, must not wait for it. One change at a time. Thread-safe.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/error.hpp"
#include "abbe/model/configuration_fit.hpp"
#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct Activation {
  std::string id;        ///< id of the model, or a beginning of it that no other model has
  std::string who, why;  ///< kept in the store
  bool force = false;    ///< true: also activate a model that the gate refused; needs `why`
};

struct RollBack {
  std::string active;    ///< id of the model that the client assumes to be active
  std::string who, why;  ///< kept in the store
};

/// A model that a client identified, as `abbe model add` takes it from a file.
struct Addition {
  std::string model;             ///< the text of model.json, with the verdict of the gate
  PresentConfiguration present;  ///< a model of another machine is refused
  std::string who, why;          ///< kept in the store
};

class StoreChanges {
 public:
  explicit StoreChanges(std::filesystem::path store) : store_(std::move(store)) {}

  /// Begins a change and returns its number. Usage for a forced activation without reason; Refused
  /// while another change runs.
  [[nodiscard]] Result<std::uint64_t> activate(Activation asked);
  /// Begins to activate the model that was active before `active`. The outcome is Refused if a
  /// model other than `active` is active.
  [[nodiscard]] Result<std::uint64_t> roll_back(RollBack asked);

  /// The same for a model that is added with its verdict, also if that is a refusal; the outcome is
  /// its id. It is not activated. BadInput for a text that is no model, or one that the gate has
  /// not judged; Refused for a model of another machine.
  [[nodiscard]] Result<std::uint64_t> add(Addition asked);

  /// Waits at most `patience` for the change. The id of the model that is active then, or the Error
  /// of the store; nullopt while the change runs. Usage for another number than the last one.
  [[nodiscard]] std::optional<Result<std::string>> outcome(std::uint64_t number,
                                                           std::chrono::milliseconds patience);

 private:
  using Change = std::function<Result<std::string>(ModelStore&)>;
  [[nodiscard]] Result<std::uint64_t> begin(Change change);

  std::filesystem::path store_;
  std::mutex mutex_;  // guards the members below
  std::uint64_t number_ = 0;
  std::future<Result<std::string>> running_;
  std::optional<Result<std::string>> done_;
};

}  // namespace abbe::daemon
