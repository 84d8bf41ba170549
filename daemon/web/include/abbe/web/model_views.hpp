#pragma once
/// What the page shows of the model store, as JSON. Lengths in mm, errors in um and urad, dates as
/// RFC 3339. Other processes change the store: what is kept is used only while the files that it
/// was made of have the same inode, time and size. Thread-safe.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/error.hpp"
#include "abbe/report/certified_values.hpp"
#include "abbe/report/model_report.hpp"

namespace abbe::web {

/// What the trend shows of a model.
struct TrendModel {
  std::string id;
  protocol::UtcTime measured{};
  daemon::CertifiedValues values;
};

class ModelViews {
 public:
  /// Of a request for a view, while another one is made.
  static constexpr std::chrono::seconds kPatience{10};

  /// Of the history, so that its answer stays below 1 MB.
  static constexpr std::size_t kMostModels = 2000;

  /// `machine_hash`: of the configured machine, for which another machine's model is STALE.
  /// `most_models`: of the history.
  explicit ModelViews(std::filesystem::path store, std::optional<std::string> machine_hash = {},
                      std::size_t most_models = kMostModels)
      : store_(std::move(store)),
        machine_hash_(std::move(machine_hash)),
        most_models_(most_models) {}

  /// Views that wait for others to be made end with an Error.
  void stop() noexcept { stopping_ = true; }

  /// {"models": [newest first], "events": [newest first], "left_out"}. The models that were
  /// added last and the active one; left_out: the number of the others.
  [[nodiscard]] daemon::Result<std::string> history();
  /// A model: verdict with reasons and notes, what it is based on, error motions with u, field of V
  /// with U, validity volume, residuals before and after, and what it does not know. `id` may be
  /// "active". The text is kept for the models that were asked for last.
  [[nodiscard]] daemon::Result<std::string> model(const std::string& id);
  /// Certified values of all accepted models of the store, oldest first, and the tables of the
  /// newest ones: {"models": [{"id", "created"}], "values": [{"key", "group", "name", "unit",
  /// "value": [], "u": []}], "tables": [{"name", "x_label", "y_label", "curves": [{"model": index,
  /// "x", "y", "u"}]}]}. u null: no uncertainty is stated.
  [[nodiscard]] daemon::Result<std::string> trend();
  /// The report of the model as an HTML page without JavaScript.
  [[nodiscard]] daemon::Result<std::string> report(const std::string& id);
  /// model.json with the verdict of the store, which may be later than that in its file.
  [[nodiscard]] daemon::Result<std::string> model_file(const std::string& id);

 private:
  /// A text, and the stamp of the files that it was made of.
  struct Kept {
    std::string stamp, text;
    std::uint64_t used = 0;  ///< number of the call that used it last
  };
  /// The kept text, or the one that `make` makes. Io if another view takes longer than kPatience.
  [[nodiscard]] daemon::Result<std::string> kept(
      const std::string& key, const std::string& stamp, std::mutex& one_at_a_time,
      const std::function<daemon::Result<std::string>()>& make);
  [[nodiscard]] std::optional<std::string> find_kept(const std::string& key,
                                                     const std::string& stamp);

  [[nodiscard]] daemon::Result<daemon::ReportSubject> subject(const std::string& id) const;

  std::filesystem::path store_;
  std::optional<std::string> machine_hash_;
  std::size_t most_models_;
  std::atomic<bool> stopping_{false};
  // One at a time, because each takes much of a processor.
  std::mutex making_model_, making_history_, making_trend_;
  std::map<std::string, TrendModel> trend_models_;  // by the stamp of the file; under making_trend_
  std::mutex mutex_;                                // of the members below
  std::map<std::string, Kept> kept_;
  std::uint64_t calls_ = 0;
};

}  // namespace abbe::web
