#pragma once
/// The file model.json, in which a model is stored and exchanged. In the file lengths are in mm,
/// errors in um and urad, covariances in products of these; in the structs all values are SI.
/// Values that are written and read again are bit-identical.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/calib/model/offset_in_model.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/config/config.hpp"
#include "abbe/model/model_verdict.hpp"
#include "abbe/model/run_figures.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

struct ResidualFigures {
  double mean_abs_m = 0.0;
  double rms_m = 0.0;
  double max_abs_m = 0.0;
  friend bool operator==(const ResidualFigures&, const ResidualFigures&) = default;
};

/// Statistics of the identification that all methods have in common.
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
  /// Degrees of freedom: number of observations minus the number of unknowns that they determine.
  /// An unknown with a prior counts in part. nullopt: not known, as in models of earlier versions.
  std::optional<double> degrees_of_freedom{};
  friend bool operator==(const ModelStatistics&, const ModelStatistics&) = default;
};

/// Drift of the tracker estimated with reference nests (calib/otf/samples/tracker_drift.hpp).
struct TrackerDriftFigures {
  calib::Vector3 largest_m = calib::Vector3::Zero();  ///< machine axes, at the centre of the path
  double u_repeatability_m = 0.0;  ///< standard uncertainty of a visit of a nest, as used
  std::size_t visits = 0;
  friend bool operator==(const TrackerDriftFigures&, const TrackerDriftFigures&) = default;
};

/// Results of an identification with a Multi-Feature Bar other than the errors, with the names of
/// its files. Features are counted from 1, touches of a feature from 0.
struct BarFigures {
  struct Pass {
    std::string measurement;
    double chi2_per_dof = 0.0;
    friend bool operator==(const Pass&, const Pass&) = default;
  };
  /// Drift of the machine during one pass, in machine axes, from a forward and a backward pass.
  struct Drift {
    std::string forward, backward;  ///< names of the measurements
    calib::Vector3 rate_m = calib::Vector3::Zero(), u_rate_m = calib::Vector3::Zero();
    friend bool operator==(const Drift&, const Drift&) = default;
  };
  struct SetAside {
    std::string measurement, feature, side;  ///< side: empty for holes and rods
    std::size_t index = 0, k = 0;
    double residual_m = 0.0;  ///< deviation from the other touches of the feature, along the normal
    friend bool operator==(const SetAside&, const SetAside&) = default;
  };
  std::vector<Pass> passes;
  std::vector<Drift> drift;
  std::vector<SetAside> set_aside;
  friend bool operator==(const BarFigures&, const BarFigures&) = default;
};

/// A model and its origin.
struct ModelDocument {
  calib::VolumetricModel model;
  std::string method = "otf";
  std::string estimator = "two-step";
  std::string machine;       ///< name in the configuration
  std::string machine_hash;  ///< machine_hash() of the configuration
  protocol::UtcTime created{};
  ModelStatistics statistics;
  std::vector<InputFile> inputs;
  /// Thermal expansion of the ball array for which the touches were corrected; nullopt: not
  /// corrected.
  std::optional<calib::Expansion> artefact{};
  /// The part that is missing in the recording of the run. Empty if the recording is complete, or
  /// if recording was switched off. A gap does not affect the uncertainty of the model, but no
  /// replay can check such a model.
  std::string recording_gap{};
  /// Method otf only: "on-the-fly" or "standstill". Empty for other methods and in files of earlier
  /// versions.
  std::string mode{};
  /// Method otf with backlash only: the differences between the directions of travel that the run
  /// determined, for display. model.travel(), on which V depends, contains all of them; models of
  /// earlier versions have only this list. Not in the hash.
  std::vector<calib::Backlash> backlash{};
  /// Method otf with reference nests only. Not in the hash, like other statistics.
  std::optional<TrackerDriftFigures> tracker_drift{};
  /// Method mfb only. Not in the hash, like other statistics.
  std::optional<BarFigures> bar{};
  /// Figures of the run. Not in the hash, like other statistics. Absent in models of earlier
  /// versions.
  std::optional<RunFigures> run{};
  /// Version of abbe that identified the model; empty: this one. Not in the hash.
  std::string software{};
  /// Decision on the model; nullopt: not judged, as in files of earlier versions. Not in the hash.
  std::optional<ModelVerdict> verdict{};
  /// Meaning of the configuration; machine_hash is the hash of its readings. nullopt: the file is
  /// from an earlier version, and machine_hash is a former_machine_hash(). Not in the hash of the
  /// model.
  std::optional<Meaning> configuration{};
  /// Method otf with a named place of the tracker only, for updates. In the hash if present.
  std::optional<calib::TrackerPlace> tracker_place{};
};
/// True if the devices that measured the data of the model were simulated; nullopt: not known, as
/// in files of earlier versions.
[[nodiscard]] std::optional<bool> made_on_simulated_devices(const ModelDocument& document);
/// Text for people: whether the devices were simulated.
[[nodiscard]] std::string_view devices_in_words(std::optional<bool> simulated);

/// Text for the verdict on a model whose recording has this gap.
[[nodiscard]] std::string cannot_be_checked(std::string_view recording_gap);

/// SHA-256 in hex over the content of the model: method, chain, basis, nodes, datum, tools,
/// parameters, covariance, validity, the corrected thermal expansion of the ball array, the
/// differences between the directions of travel, the misfit, and the place of the tracker. Dates,
/// inputs and statistics are not included, so that the live model and its replay have equal hashes.
[[nodiscard]] std::string model_hash(const ModelDocument& document);

/// The id of a model in commands and in the store: 16 digits of a hash over model_hash() and the
/// machine configuration of the model. Equal models for two machine configurations have different
/// ids, because one of them is STALE with the configuration with which the other is ACTIVE.
[[nodiscard]] std::string model_id(const ModelDocument& document);

/// The text of model.json; the same document gives the same bytes.
[[nodiscard]] std::string to_json(const ModelDocument& document);

/// Reads the text of a model.json. BadInput with the faults in Error::details; a text whose stored
/// hash differs from the hash of its content is such a fault. `file` is used only in error
/// messages.
[[nodiscard]] Result<ModelDocument> parse_model(std::string_view text, const std::string& file);
[[nodiscard]] Result<ModelDocument> read_model(const std::filesystem::path& file);

/// CSV with the columns `name,value,u,unit`: the coefficients of [Li OMM] Table 3 in mm and rad,
/// for a polynomial model.
[[nodiscard]] std::string to_coefficients_csv(const calib::PolynomialModel& model);

/// All: so many digits that reading gives the same bits. Six: six significant digits, for people.
enum class Digits { All, Six };

/// CSV with the columns `name,position_mm,value,u,unit`: tables and squareness, then backlash
/// (`EXX.backlash`).
[[nodiscard]] std::string to_tables_csv(const calib::VolumetricModel& model,
                                        std::span<const calib::Backlash> backlash = {},
                                        Digits digits = Digits::All);

/// Note in the verdict if a candidate is not compared with the active model.
inline constexpr std::string_view kOfAnotherMachine =
    "not compared with the active model: that model belongs to another machine configuration";

}  // namespace abbe::daemon
