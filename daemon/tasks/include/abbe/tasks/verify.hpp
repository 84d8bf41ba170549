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
#include "abbe/tasks/same_machine.hpp"
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
  std::string out;  ///< folder for measured points; empty: they are not kept
  std::string tool, frame = "fit", origin, grid, planes;
  std::optional<double> least_distance_mm{};
  StoreOption store{};
  bool other_machine = false;
};

struct VerifyOutcome {
  ModelDocument document;
  Verification verification;
  std::vector<std::string> points_off{};  ///< points that alone do not fit, one line each
  std::string machine;                    ///< of_machine() of the model
};

/// The first of `arguments.models` against the points. Sets `cut_short` if points are missing, even
/// if the comparison fails: the missing points may be the cause of its failure.
[[nodiscard]] Result<VerifyOutcome> verify_model(const VerifyArguments& arguments,
                                                 std::optional<Error>& cut_short,
                                                 const Progress& progress);

/// The points for models of `machines`. They must be of the same machine, as far as it is known: a
/// file of points does not state it. `different`: different_machines().
[[nodiscard]] Result<LivePoints> points_of(const VerifyArguments& arguments,
                                           std::vector<OfMachine> machines, std::string& different,
                                           const Progress& progress);
/// The points in the frame that the arguments name; an error names points that alone do not fit.
[[nodiscard]] Result<calib::verify::Observations> observed_in(const VerifyArguments& arguments,
                                                              const VerificationFile& file);

}  // namespace abbe::daemon
