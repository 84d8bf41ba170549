#pragma once
/// What every "abbe identify" does with its model, whatever method made it.

#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/gate.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The active model of the store the result will be kept in; none if `store` is empty.
[[nodiscard]] Result<std::optional<ModelDocument>> active_model(const std::string& store);

/// What a candidate must do better than.
struct ModelToBeat {
  const calib::VolumetricModel* model = nullptr;
  std::string
      left_out;  ///< why the active model is not asked; empty: there is none, or it is asked

  void say(calib::Verdict& verdict) const;  ///< adds `left_out` to its notes
};

/// The active model if it was made for the machine of `config`: another configuration's is STALE
/// there, and must not lock out the one that replaces it.
[[nodiscard]] ModelToBeat to_beat(const std::optional<ModelDocument>& active, const Config& config);

/// Adds the model to the store, by whom and by `command`; nothing if `store` is empty.
[[nodiscard]] Result<void> keep(const std::string& store, const ModelDocument& document,
                                const calib::Verdict& verdict, const std::string& command);

/// model.json and `more` (file name to text) into the folder, which is created if needed. Error Io.
[[nodiscard]] Result<void> write_results(const std::filesystem::path& folder,
                                         const ModelDocument& document,
                                         const std::map<std::string, std::string>& more);

/// Whether it is accepted, why not, and what else to know.
[[nodiscard]] nlohmann::json verdict_json(const calib::Verdict& verdict);

/// The held-out residuals and what the gate would do, on stdout.
void print_verdict(const calib::Verdict& verdict);

/// 0, or that of a refusal: the results are written either way.
[[nodiscard]] int exit_code(const calib::Verdict& verdict);

}  // namespace abbe::daemon
