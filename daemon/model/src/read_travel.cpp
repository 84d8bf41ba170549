#include "read_travel.hpp"
#include "abbe/calib/model/backlash.hpp"

#include <fmt/format.h>

#include <cmath>

namespace abbe::daemon {

namespace {

calib::Backlash read_difference(ModelReader& in, const ModelJson& entry, const std::string& path) {
  const ModelJson* name = in.find(entry, path, "name");
  const auto motion = name != nullptr && name->is_string()
                          ? calib::error_motion(name->get<std::string>())
                          : std::nullopt;
  if (!motion) in.fault(path + ".name", "must be an error such as EXX");
  const ModelJson* unit = in.find(entry, path, "unit");
  if (unit != nullptr && motion && *unit != unit_of(*motion))
    in.fault(path + ".unit", fmt::format("must be \"{}\"", unit_of(*motion)));

  calib::Backlash b{.motion = motion.value_or(calib::ErrorMotion{}),
                    .value = in.number_of(entry, path, "value", kMicroUnit),
                    .u = in.number_of(entry, path, "u", kMicroUnit),
                    .determined = true};
  if (entry.is_object() && entry.contains("position_mm"))
    b.position_m = in.number_of(entry, path, "position_mm", kMm);
  return b;
}

std::vector<calib::Backlash> read_differences(ModelReader& in, const ModelJson& list,
                                              const std::string& path) {
  std::vector<calib::Backlash> all;
  if (!list.is_array()) in.fault(path, "must be an array");
  for (std::size_t i = 0; list.is_array() && i < list.size(); ++i)
    all.push_back(read_difference(in, list[i], fmt::format("{}[{}]", path, i)));
  return all;
}

/// Reads the covariance row by row: each row has the covariances of a difference with the n
/// parameters, with itself, and with the differences after it.
void read_travel_covariance(ModelReader& in, const ModelJson& travel, Eigen::Index n,
                            calib::TravelDifferences& out) {
  const std::string path = "travel.covariance";
  const ModelJson* list = in.find(travel, "travel", "covariance");
  if (list == nullptr) return;
  const Eigen::Index m = out.D.size();
  const auto values = in.numbers(*list, path, kMicroUnitSquared);
  const auto expected = static_cast<std::size_t>(m * n + m * (m + 1) / 2);
  if (values.size() != expected)
    return in.fault(path, fmt::format("{} values, expected {}", values.size(), expected));

  out.cov_U_D.resize(n, m);
  out.covariance.resize(m, m);
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) out.cov_U_D(j, i) = values[k++];
    for (Eigen::Index j = i; j < m; ++j) out.covariance(i, j) = out.covariance(j, i) = values[k++];
  }
}

bool is_same_place(const calib::Backlash& a, const calib::Backlash& b) {
  constexpr double kSameNode_m = 1e-9;  // decimal numbers in mm differ by rounding
  return a.motion == b.motion && a.position_m.has_value() == b.position_m.has_value() &&
         (!a.position_m || std::abs(*a.position_m - *b.position_m) < kSameNode_m);
}

}  // namespace

std::vector<calib::Backlash> read_backlash(ModelReader& in) {
  const std::string path = "backlash";
  if (!in.root().is_object() || !in.root().contains(path)) return {};
  return read_differences(in, in.root().at(path), path);
}

std::optional<StoredTravel> read_travel(ModelReader& in, std::size_t parameters) {
  const std::string path = "travel";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& travel = in.root().at(path);
  const ModelJson* kind = in.find(travel, path, "kind");
  const auto known = kind != nullptr && kind->is_string()
                         ? calib::backlash_named(kind->get<std::string>())
                         : std::nullopt;
  if (!known || *known == calib::TravelDependence::None)
    in.fault("travel.kind", "must be \"per-table\" or \"forward-backward\"");

  StoredTravel out;
  out.differences.kind = known.value_or(calib::TravelDependence::Backlash);
  if (const ModelJson* list = in.find(travel, path, "differences"))
    out.list = read_differences(in, *list, "travel.differences");
  out.differences.D.resize(std::ssize(out.list));
  for (std::size_t i = 0; i < out.list.size(); ++i)
    out.differences.D(static_cast<Eigen::Index>(i)) = out.list[i].value;
  read_travel_covariance(in, travel, static_cast<Eigen::Index>(parameters), out.differences);

  return out;
}

void check_names(ModelReader& in, const StoredTravel& travel, const calib::VolumetricModel& model) {
  const auto expected = calib::backlash_of(model);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (is_same_place(travel.list[i], expected[i])) continue;
    return in.fault(
        fmt::format("travel.differences[{}]", i),
        fmt::format("is {}, expected {}", calib::label(travel.list[i]), calib::label(expected[i])));
  }
}

}  // namespace abbe::daemon
