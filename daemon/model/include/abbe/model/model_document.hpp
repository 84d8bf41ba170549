#pragma once
/// A model as it is written, kept and exchanged: model.json. Lengths in the file are mm, errors um
/// and urad, covariance in products of those; here everything is SI. What is written reads back to
/// the same bits.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/volumetric_model.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

struct ResidualFigures {
  double mean_abs_m = 0.0;
  double rms_m = 0.0;
  double max_abs_m = 0.0;
  friend bool operator==(const ResidualFigures&, const ResidualFigures&) = default;
};

/// How the model came about, in the terms every method shares.
struct ModelStatistics {
  std::size_t samples = 0, lost_samples = 0;
  std::size_t observations = 0, unknowns = 0, rank = 0;
  double condition = 0.0;
  double sigma0 = 0.0;
  double chi2_per_dof = 0.0;
  double variance_factor = 1.0;  ///< see calib::otf::Statistics
  ResidualFigures before, after;
  int iterations = 0;
  std::string stop_reason;
  friend bool operator==(const ModelStatistics&, const ModelStatistics&) = default;
};

/// A model and where it came from.
struct ModelDocument {
  calib::VolumetricModel model;
  std::string method = "otf";
  std::string estimator = "two-step";
  std::string machine;       ///< name in the configuration
  std::string machine_hash;  ///< machine_hash() of the configuration
  protocol::UtcTime created{};
  ModelStatistics statistics;
  std::vector<InputFile> inputs;
  std::optional<calib::Expansion> artefact{};  ///< of a ball array that counts as warm
  /// What the recording of the run lacks; empty: nothing, or nothing was recorded on purpose. Such
  /// a model is as sure as the data it was identified from, but no replay can check it.
  std::string recording_gap{};
};
/// For the verdict of a model whose recording has this gap.
[[nodiscard]] std::string cannot_be_checked(std::string_view recording_gap);

/// SHA-256 in hex over what the model *says* (method, chain, basis, nodes, gauge, tools,
/// parameters, covariance, validity, and what warmth of a ball array was taken out of it), not over
/// dates, inputs or statistics: the live model's hash equals the replay's.
[[nodiscard]] std::string model_hash(const ModelDocument& document);

/// How people and the store call a model: 16 digits of a hash over model_hash() and the machine
/// configuration it was made for. The same model found again under another configuration is another
/// document: one is STALE where the other is ACTIVE.
[[nodiscard]] std::string model_id(const ModelDocument& document);

/// The text of model.json; the same document gives the same bytes.
[[nodiscard]] std::string to_json(const ModelDocument& document);

/// BadInput with every fault in Error::details. `file` only names the text in errors. A text whose
/// recorded hash is not the hash of its content is refused.
[[nodiscard]] Result<ModelDocument> parse_model(std::string_view text, const std::string& file);
[[nodiscard]] Result<ModelDocument> read_model(const std::filesystem::path& file);

/// `name,value,u,unit`: the coefficients of [Li OMM] Table 3 in mm and rad, of a model in
/// polynomials.
[[nodiscard]] std::string to_coefficients_csv(const calib::evemu::EvemuModel& model);

/// `name,position_mm,value,u,unit`
[[nodiscard]] std::string to_tables_csv(const calib::VolumetricModel& model);

/// Said where a candidate is not compared with the active model.
inline constexpr std::string_view kOfAnotherMachine =
    "not compared with the active model: that one was made for another machine configuration";

}  // namespace abbe::daemon
