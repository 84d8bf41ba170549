#include "read_tracker_place.hpp"

#include <fmt/format.h>

namespace abbe::daemon {

std::optional<calib::TrackerPlace> read_tracker_place(ModelReader& in, std::size_t parameters) {
  const std::string path = "tracker_place";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& stored = in.root().at(path);
  calib::TrackerPlace place;
  place.name = in.text_of(stored, path, "name");
  calib::OffsetInModel& offset = place.range_offset;
  offset.value_m = in.number_of(stored, path, "range_offset_um", kMicroUnit);
  offset.u_m = in.number_of(stored, path, "u_um", kMicroUnit);
  offset.u_prior_m = in.number_of(stored, path, "u_prior_um", kMicroUnit);
  if (!(offset.u_m > 0.0)) in.fault(path + ".u_um", "must be positive");
  if (!(offset.u_prior_m > 0.0)) in.fault(path + ".u_prior_um", "must be positive");

  if (const ModelJson* list = in.find(stored, path, "derivatives")) {
    const auto values = in.numbers(*list, path + ".derivatives", 0);
    if (values.size() != parameters)
      in.fault(path + ".derivatives",
               fmt::format("{} values for {} parameters", values.size(), parameters));
    offset.dU_dd =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  return place;
}

}  // namespace abbe::daemon
