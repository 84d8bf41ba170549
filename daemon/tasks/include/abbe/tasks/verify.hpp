#pragma once
/// Compares a model with independent measurements at points in the volume.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/model_source.hpp"
#include "abbe/tasks/progress.hpp"
#include "abbe/tasks/verification_report.hpp"

namespace abbe::daemon {

struct LivePoints {
  VerificationFile file;  ///< for points measured by the daemon, `source` has no name
  /// The reason why points are missing: the daemon does not answer any more (Io), or the recording
  /// is damaged before its end (DataInsufficient).
  std::optional<Error> cut_short;
  std::string machine{};  ///< machine on which the points were measured; empty: not known
};

/// Called with all points whenever there are new ones. If it returns an Error, the measurement
/// ends.
using KeepPoints = std::function<Result<void>(const VerificationFile&)>;
/// Called before the first point, with the machine on which the points are measured (empty: not
/// known). An Error that it returns ends the measurement.
using AcceptMachine = std::function<Result<void>(const std::string& machine)>;

/// Arguments as given by the user: file names and values. Exactly one of points, recording and live
/// is given.
struct VerifyArguments {
  std::vector<std::string> models;
  std::string points, recording;
  /// Measures points on the running machine.
  std::function<Result<LivePoints>(const KeepPoints&, const AcceptMachine&)> live{};
  std::string out;      ///< folder in which measured points are kept; empty: they are not kept
  std::string details;  ///< certificate.toml; empty: none
  std::string tool, frame = "fit", origin, grid, planes;
  std::optional<double> least_distance_mm{};
  StoreOption store{};
  bool other_machine = false;
  /// For points that another program exported: the file with the readings, and the unit.
  /// `frame_stated` must then be true.
  std::string readings{}, points_unit{};
  bool frame_stated = false;
};

/// Compares one model, or several models at the same points (for example models of runs at several
/// feeds). Usage: no model; not exactly one source of points; live points without `out`; an invalid
/// vector; models of different machines without `other_machine`; with several models, an argument
/// that is only for one model, or different tool offsets without `arguments.tool`.
/// DataInsufficient: fewer than 4 places inside the validity volume of all models.
/// `cut_short` is set if points are missing, even if the comparison fails, because the missing
/// points may be the cause of the failure.
[[nodiscard]] Result<Verification> verify_models(const VerifyArguments& arguments,
                                                 std::optional<Error>& cut_short,
                                                 const Progress& progress);

}  // namespace abbe::daemon
