#pragma once
/// What the page shows of the model store, as JSON. Lengths in mm, errors in um and urad, dates as
/// RFC 3339. Reads the store at every call, as other processes change it. Thread-safe.

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::web {

class ModelViews {
 public:
  explicit ModelViews(std::filesystem::path store) : store_(std::move(store)) {}

  /// {"models": [newest first], "events": [newest first]}.
  [[nodiscard]] daemon::Result<nlohmann::json> history() const;
  /// A model: what it is based on, error motions with u, field of V with U, validity volume,
  /// residuals before and after, and what it does not know. `id` may be "active". The text is kept
  /// for the models that were asked for last.
  [[nodiscard]] daemon::Result<std::string> model(const std::string& id);
  /// Certified values of all accepted models of the store, oldest first:
  /// {"models": [{"id", "created"}], "values": [{"key", "name", "unit", "value": [], "u": []}]}.
  [[nodiscard]] daemon::Result<std::string> trend();
  /// The report of the model as an HTML page without JavaScript.
  [[nodiscard]] daemon::Result<std::string> report(const std::string& id) const;
  /// The bytes of model.json.
  [[nodiscard]] daemon::Result<std::string> model_file(const std::string& id) const;

 private:
  std::filesystem::path store_;
  std::mutex mutex_;  // of the members below
  std::map<std::string, std::string> views_;
  std::string trend_, trend_of_;
};

}  // namespace abbe::web
