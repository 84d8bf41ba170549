#pragma once
/// Upkeep of the model store in the background, at the start and then every hour. It updates the
/// index of the store, so that readers that may not write to the store need not read every model.
/// It also removes the models that [models] does not keep.

#include <chrono>
#include <filesystem>
#include <future>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

class StoreUpkeep {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  StoreUpkeep(std::filesystem::path store, ModelRetention retention)
      : store_(std::move(store)), retention_(retention) {}

  /// Begins the work when it is due, and reports the models that the previous work removed on
  /// stderr. Never waits.
  void cycle(WallTime now);

 private:
  std::filesystem::path store_;
  ModelRetention retention_;
  std::future<Result<std::vector<std::string>>> work_;
  WallTime next_{};  ///< the first work is due at once
};

}  // namespace abbe::daemon
