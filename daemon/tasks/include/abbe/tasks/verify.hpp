#pragma once
/// A model against independent measurements at points in the volume.

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
  VerificationFile file;  ///< for points of the daemon `source` has no name
  /// Why points are missing: the daemon does not answer any more (Io), or the recording is damaged
  /// before its end (DataInsufficient).
  std::optional<Error> cut_short;
  std::string machine{};  ///< whose points they are; empty: not known
};

/// Called with all points whenever there are new ones; an error ends the measurement.
using KeepPoints = std::function<Result<void>(const VerificationFile&)>;
/// Called with the machine of the points (empty: not known) before the first; its error is
/// returned.
using AcceptMachine = std::function<Result<void>(const std::string& machine)>;

/// File names and values as a person gives them; one of points, recording and live.
struct VerifyArguments {
  std::vector<std::string> models;
  std::string points, recording;
  /// Measures points on the running machine.
  std::function<Result<LivePoints>(const KeepPoints&, const AcceptMachine&)> live{};
  std::string out;      ///< folder for measured points; empty: they are not kept
  std::string details;  ///< certificate.toml; empty: none
  std::string tool, frame = "fit", origin, grid, planes;
  std::optional<double> least_distance_mm{};
  StoreOption store{};
  bool other_machine = false;
  /// Of points that another program exported: file of the readings, unit. Such points also need a
  /// stated `frame`.
  std::string readings{}, points_unit{};
  bool frame_stated = false;
};

/// One model, or several at the same points, for example of runs at several feeds. Usage: no
/// model, not exactly one source of points, live points without `out`, a vector that is none, models
/// of different machines without `other_machine`, an argument that is for one model, different tool
/// offsets of the models without `arguments.tool`.
/// DataInsufficient: fewer than 4 places inside the validity volume of all models. Sets `cut_short`
/// if points are missing, even if the comparison fails: the missing points may be the cause of its
/// failure.
[[nodiscard]] Result<Verification> verify_models(const VerifyArguments& arguments,
                                                 std::optional<Error>& cut_short,
                                                 const Progress& progress);

}  // namespace abbe::daemon
