#pragma once
/// The common part of all identifications: the active model with which the gate compares, and the
/// places to which the result is written.

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// The active model of a store.
struct ActiveDocument {
  ModelDocument document;
  std::string accepted_configuration;  ///< StoreEvent::accepted_configuration of its activation
};

/// The active model of the store in which the result will be kept; nullopt if `store` is empty.
[[nodiscard]] Result<std::optional<ActiveDocument>> active_model(const std::string& store);

/// The model with which the gate compares a candidate.
struct ComparisonModel {
  const calib::VolumetricModel* model = nullptr;  ///< null: no comparison
  /// reason why the active model is not compared; empty: it is compared, or there is none
  std::string left_out;

  void add_note(calib::Verdict& verdict) const;  ///< adds `left_out` to the notes of `verdict`
};

/// The active model, if it was made, or accepted, for the machine of `config`. A model of another
/// machine configuration is never applied to this machine. Therefore the gate must not compare a
/// new model with it.
[[nodiscard]] ComparisonModel comparison_model(const std::optional<ActiveDocument>& active,
                                               const Config& config);

/// The places to which the result is written, as the options of the command state them.
struct ResultPlace {
  std::string out;      ///< folder, created if needed
  std::string keep;     ///< store, or empty
  std::string command;  ///< recorded in the store as reason, "abbe identify otf"
  std::string pdf{};    ///< file for the report as PDF; or empty
};
/// File contents by file name.
using ResultFiles = std::map<std::string, std::string>;

/// Writes model.json with the verdict, `more` and report.html, adds the model to the store with the
/// user, and writes report.html again. Nothing is stored if a file cannot be written or the report
/// cannot be made. The PDF comes last: its converter may be missing or fail (Io).
/// With a store, report.html is the report that `abbe report` makes of the stored model. Without a
/// store it contains the verdict and states that the model is not active. Error Io, or that of the
/// store.
[[nodiscard]] Result<void> write_and_keep(const ResultPlace& place, const ModelDocument& document,
                                          const calib::Verdict& verdict, const ResultFiles& more,
                                          const Progress& progress = {});

/// Whether the gate accepts the model, the reasons if not, and the notes.
[[nodiscard]] nlohmann::json verdict_json(const calib::Verdict& verdict);

}  // namespace abbe::daemon
