#pragma once
/// The interface of the on-the-fly method to the session, the replay and the control API; see
/// method_list.hpp.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/methods/identification_watch.hpp"
#include "abbe/methods/method_list.hpp"
#include "abbe/methods/otf/acquisition.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

struct OtfRequest {
  std::vector<AxisPosition> path_m;
  std::optional<calib::otf::Mode> mode{};  ///< nullopt: that of the configuration
};

struct OtfMethod {
  static constexpr std::string_view kName = "otf";
  using Request = OtfRequest;
  using Options = AcquisitionOptions;
  using Acquisition = OtfAcquisition;
  using Run = OtfRun;
  using Candidate = OtfCandidate;

  [[nodiscard]] static MethodNeeds needs(const Config&) { return {.tracker = true}; }
  [[nodiscard]] static Options options(const Config& config);
  [[nodiscard]] static nlohmann::json to_json(const Request& request);
  /// Reads a request. If "mode" is missing, the mode of [otf] of `config` is used, or nullopt if
  /// `config` is null. Throws nlohmann::json::exception for another member that is missing, or for
  /// one of the wrong type.
  [[nodiscard]] static Request request_from(const nlohmann::json& object, const Config* config);
  /// Refused if the tracker is configured for stationary mode; the other errors are those of
  /// check_otf_path().
  [[nodiscard]] static Result<void> check(const Request& request, const Config& config);
  [[nodiscard]] static Result<Acquisition> acquire(Request&& request, const Options& options);
  /// The input of the identification: all points in one vector, and the path corrected for the
  /// temperature of the scales. O(n) in points and vertices.
  [[nodiscard]] static Run run_of(Acquisition&& acquisition);
  [[nodiscard]] static Result<Candidate> identify(const Run& run, const Config& config,
                                                  const calib::VolumetricModel* active,
                                                  const IdentificationWatch& watch);
  [[nodiscard]] static std::vector<InputFile> inputs_of(const Run& run);
  [[nodiscard]] static ModelDocument document_of(const Candidate& candidate, const Config& config,
                                                 std::vector<InputFile> inputs,
                                                 protocol::UtcTime created);
};

}  // namespace abbe::daemon
