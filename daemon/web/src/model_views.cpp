#include "abbe/web/model_views.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/report/measured_time.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/result/try.hpp"
#include "lock_within.hpp"
#include "model_json.hpp"

namespace abbe::web {
namespace {

using daemon::ModelDocument;
using daemon::ModelStore;
using daemon::Result;
using daemon::StoreAction;
using daemon::StoreEntry;
using daemon::StoreEvent;
using nlohmann::json;

constexpr std::size_t kMostViews = 12;         ///< history, trend, models of some 100 kB, reports
constexpr std::size_t kMostTrendModels = 100;  ///< those that were added last
constexpr std::size_t kMostTableModels = 6;    ///< measured last; their tables are in the trend
constexpr std::size_t kMostEvents = 200;       ///< the newest

/// Invalid UTF-8, which names of files may contain, is replaced.
std::string text_of(const json& value) {
  return daemon::json_text(value);
}

std::string_view action_in_words(StoreAction action) {
  switch (action) {
    case StoreAction::Added:
      return "added";
    case StoreAction::Activated:
      return "activated";
    case StoreAction::Forced:
      return "activated by force";
    case StoreAction::RolledBack:
      return "rolled back";
    case StoreAction::Drifted:
      return "drift found";
    case StoreAction::Removed:
      return "removed";
  }
  return "";
}

json entry_json(const StoreEntry& entry) {
  return {{"id", entry.id},
          {"active", entry.active},
          {"accepted", entry.accepted},
          {"judged", entry.judged},
          {"reasons", entry.reasons},
          {"added", daemon::to_text(entry.added)},
          {"method", entry.method},
          {"machine", entry.machine},
          {"fault", entry.fault},
          {"simulated", entry.simulated.value_or(false)}};
}

json event_json(const StoreEvent& event) {
  return {{"action", action_in_words(event.action)},
          {"id", event.id},
          {"who", event.actor.who},
          {"why", event.actor.why},
          {"when", daemon::to_text(event.actor.when)}};
}

Result<std::string> id_of(const ModelStore& store, const std::string& name) {
  if (name != "active") return store.find(name);
  auto active = store.active_id();
  ABBE_TRY(active);
  if (*active) return **active;
  return daemon::fail(daemon::ErrorCode::Refused, "no model is active");
}

struct TrendValue {
  std::string group, name;
  bool is_angle = false;
  std::vector<json> value, u;  ///< one for each model; null: the model does not have it
};

/// Adds the values of one model, the `index`-th of the trend.
void add_to_trend(std::vector<std::pair<std::string, TrendValue>>& trend, std::size_t index,
                  const daemon::CertifiedValues& values) {
  for (const auto& group : values.groups) {
    for (const auto& v : group.values) {
      if (v.value.empty()) continue;
      auto found = std::ranges::find(trend, v.key, &std::pair<std::string, TrendValue>::first);
      if (found == trend.end())
        found = trend.insert(trend.end(), {v.key, {group.name, v.name, v.is_angle, {}, {}}});
      TrendValue& row = found->second;
      row.value.resize(index);
      row.u.resize(index);
      row.value.push_back(daemon::kUmPerM * v.value_si);
      row.u.push_back(v.U.empty() ? json{} : json(daemon::kUmPerM * v.u_si));
    }
  }
}

/// Rounded to 0.1 nm or 0.1 nrad, so that the answer stays short.
json rounded(const std::vector<double>& values) {
  constexpr double kPerUnit = 1e4;
  json out = json::array();
  for (const double value : values) out.push_back(std::round(value * kPerUnit) / kPerUnit);
  return out;
}

/// A table of the models, with one curve for each.
struct TrendTable {
  std::string x_label, y_label;
  json curves = json::array();
};

/// Adds the tables of one model, the `index`-th of the trend.
void add_to_tables(std::map<std::string, TrendTable>& tables, std::size_t index,
                   const calib::VolumetricModel& model) {
  for (const daemon::LineChart& chart : daemon::table_line_charts(model)) {
    for (const daemon::Curve& curve : chart.curves) {
      TrendTable& table = tables[curve.key];
      table.x_label = chart.x_label;
      table.y_label = chart.y_label;
      table.curves.push_back({{"model", index},
                              {"x", rounded(curve.x)},
                              {"y", rounded(curve.y)},
                              {"u", rounded(curve.u)}});
    }
  }
}

/// Inode, time and size of a file; empty if there is none.
std::string stamp_of(const std::filesystem::path& file) {
  struct stat seen {};
  if (::stat(file.c_str(), &seen) != 0) return {};
  return fmt::format("{} {}.{} {};", seen.st_ino, seen.st_mtim.tv_sec, seen.st_mtim.tv_nsec,
                     seen.st_size);
}

/// Of the state file, which has verdicts and events.
std::string events_stamp(const ModelStore& store) {
  const auto state = store.stamp();
  return fmt::format("{} {} {};", state.inode, state.modified_ns, state.bytes);
}

/// The stamps of the state file and of all models: much less work than to read the models.
std::string stamp_of(const ModelStore& store) {
  const auto folder = store.model_path("any").parent_path();
  std::vector<std::string> models;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error))
    models.push_back(at->path().filename().string() + " " + stamp_of(at->path()));
  std::ranges::sort(models);  // the order of a folder is arbitrary
  return events_stamp(store) + fmt::format("{}", fmt::join(models, ""));
}

Result<std::string> history_text(const ModelStore& store, std::size_t most_models) {
  const auto entries = store.list();
  ABBE_TRY(entries);
  const auto events = store.history();
  ABBE_TRY(events);

  json out{{"models", json::array()}, {"events", json::array()}};
  for (std::size_t i = 0; i < entries->size(); ++i) {
    const StoreEntry& entry = (*entries)[i];
    if (i < most_models || entry.active) out["models"].push_back(entry_json(entry));
  }
  out["left_out"] = entries->size() - out["models"].size();
  const std::size_t first = events->size() - std::min(events->size(), kMostEvents);
  for (std::size_t i = events->size(); i > first; --i)
    out["events"].push_back(event_json((*events)[i - 1]));
  return text_of(out);
}

/// nullopt: the model cannot be read, or has no certified values.
std::optional<TrendModel> trend_model(const ModelStore& store, const std::string& id) {
  const auto document = store.load(id);
  if (!document) return std::nullopt;
  auto values = daemon::certified_values(*document);
  if (!values) return std::nullopt;
  return TrendModel{id, daemon::time_of(*document), *std::move(values)};
}

/// Accepted models, the one that was measured first at the beginning. `known` are those of the last
/// call, by the stamp of their file; it becomes those of this call.
Result<std::vector<TrendModel>> trend_models(const ModelStore& store,
                                             std::map<std::string, TrendModel>& known) {
  auto entries = store.list();
  ABBE_TRY(entries);
  std::erase_if(*entries, [](const StoreEntry& e) { return !e.accepted || !e.fault.empty(); });
  if (entries->size() > kMostTrendModels) entries->resize(kMostTrendModels);
  std::ranges::reverse(*entries);  // in the order of adding, which decides at the same time

  std::vector<TrendModel> models;
  std::map<std::string, TrendModel> read;
  for (const StoreEntry& entry : *entries) {
    const std::string file = stamp_of(store.model_path(entry.id));
    const auto same = known.find(file);
    const auto model =
        same != known.end() ? std::optional{same->second} : trend_model(store, entry.id);
    if (!model) continue;
    read.emplace(file, *model);
    models.push_back(*model);
  }
  known = std::move(read);
  std::ranges::stable_sort(models, {}, &TrendModel::measured);
  return models;
}

Result<std::string> trend_text(const ModelStore& store, std::map<std::string, TrendModel>& known) {
  const auto found = trend_models(store, known);
  ABBE_TRY(found);

  json models = json::array();
  std::vector<std::pair<std::string, TrendValue>> trend;
  std::map<std::string, TrendTable> tables;
  for (std::size_t i = 0; i < found->size(); ++i) {
    const TrendModel& model = (*found)[i];
    add_to_trend(trend, i, model.values);
    models.push_back({{"id", model.id}, {"measured", daemon::to_text(model.measured)}});
    if (i + kMostTableModels < found->size()) continue;
    if (const auto document = store.load(model.id)) add_to_tables(tables, i, document->model);
  }

  json rows = json::array();
  for (auto& [key, row] : trend) {
    row.value.resize(models.size());
    row.u.resize(models.size());
    rows.push_back({{"key", key},
                    {"group", row.group},
                    {"name", row.name},
                    {"unit", row.is_angle ? "urad" : "um"},
                    {"value", row.value},
                    {"u", row.u}});
  }
  json curves = json::array();
  for (auto& [name, table] : tables)
    curves.push_back({{"name", name},
                      {"x_label", table.x_label},
                      {"y_label", table.y_label},
                      {"curves", std::move(table.curves)}});
  return text_of(
      {{"models", std::move(models)}, {"values", std::move(rows)}, {"tables", std::move(curves)}});
}

}  // namespace

Result<std::string> ModelViews::kept(const std::string& key, const std::string& stamp,
                                     std::mutex& one_at_a_time,
                                     const std::function<Result<std::string>()>& make) {
  if (auto known = find_kept(key, stamp)) return std::move(*known);
  const auto turn = lock_within(one_at_a_time, kPatience, stopping_);
  if (auto known = find_kept(key, stamp)) return std::move(*known);  // made meanwhile
  if (stopping_) return daemon::fail(daemon::ErrorCode::Io, "abbe-web stops");
  if (!turn)
    return daemon::fail(daemon::ErrorCode::Io,
                        fmt::format("{}: other views have been made for {} s: try again in some "
                                    "seconds",
                                    key, kPatience.count()));
  auto text = make();
  if (!text) return text;
  const std::lock_guard lock(mutex_);
  if (kept_.size() >= kMostViews && !kept_.contains(key))
    kept_.erase(std::ranges::min_element(kept_, {}, [](const auto& k) { return k.second.used; }));
  kept_[key] = {stamp, *text, ++calls_};
  return text;
}

std::optional<std::string> ModelViews::find_kept(const std::string& key, const std::string& stamp) {
  const std::lock_guard lock(mutex_);
  const auto known = kept_.find(key);
  if (known == kept_.end() || known->second.stamp != stamp) return std::nullopt;
  known->second.used = ++calls_;
  return known->second.text;
}

Result<daemon::ReportSubject> ModelViews::subject(const std::string& id) const {
  auto found = daemon::report_subject(ModelStore{store_}, id);
  if (found) found->machine_hash = machine_hash_;
  return found;
}

Result<std::string> ModelViews::history() {
  const ModelStore store{store_};
  return kept("history", stamp_of(store), making_history_,
              [&] { return history_text(store, most_models_); });
}

Result<std::string> ModelViews::model(const std::string& name) {
  const ModelStore store{store_};
  const auto id = id_of(store, name);
  ABBE_TRY(id);
  return kept("model " + *id, stamp_of(store.model_path(*id)) + events_stamp(store), making_model_,
              [&]() -> Result<std::string> {
                const auto found = subject(*id);
                ABBE_TRY(found);
                return text_of(model_json(*found));
              });
}

Result<std::string> ModelViews::trend() {
  const ModelStore store{store_};
  return kept("trend", stamp_of(store), making_trend_,
              [&] { return trend_text(store, trend_models_); });
}

Result<std::string> ModelViews::report(const std::string& name) {
  const ModelStore store{store_};
  const auto id = id_of(store, name);
  ABBE_TRY(id);
  return kept("report " + *id, stamp_of(store), making_model_, [&]() -> Result<std::string> {
    const auto found = subject(*id);
    ABBE_TRY(found);
    return daemon::model_report(*found);
  });
}

Result<std::string> ModelViews::model_file(const std::string& name) {
  const ModelStore store{store_};
  const auto id = id_of(store, name);
  ABBE_TRY(id);
  return kept("file " + *id, stamp_of(store.model_path(*id)) + events_stamp(store), making_model_,
              [&]() -> Result<std::string> {
                const auto stored = daemon::stored_model(store, *id);
                ABBE_TRY(stored);
                return daemon::to_json(stored->document);
              });
}

}  // namespace abbe::web
