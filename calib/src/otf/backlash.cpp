#include "abbe/calib/otf/backlash.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "message.hpp"

namespace abbe::calib::otf {
namespace {

/// The differences D, of `basis`, with their values and uncertainties.
std::vector<Backlash> listed_differences(const estimation::TableBasis& basis,
                                         const Eigen::VectorXd& D,
                                         const Eigen::MatrixXd& covariance) {
  constexpr double kOfPrior = 0.5;  // three quarters of the information are the data's
  const bool per_node = basis.travel() == estimation::TravelDependence::Tables;
  std::vector<Backlash> all;
  for (const Table& table : basis.layout().tables()) {
    const std::vector<double>& nodes_m = basis.layout().nodes()[index(table.motion.axis)].nodes_m;
    for (std::size_t node = 0; node < (per_node ? nodes_m.size() : 1); ++node) {
      const auto i = std::ssize(all);
      Backlash b{table.motion, {}, D(i), std::sqrt(covariance(i, i)), false};
      b.determined = b.u < kOfPrior * kUOfBacklash;
      if (per_node) {
        b.position_m = nodes_m[node];
      }
      all.push_back(b);
    }
  }
  return all;
}

TravelDifferences differences_in(const Observations& o, const Eigen::VectorXd& U,
                                 const Eigen::MatrixXd& covariance) {
  const auto n = static_cast<Eigen::Index>(o.layout().model_size()),
             m = static_cast<Eigen::Index>(o.basis.size()) - n;
  return {.kind = o.basis.travel(),
          .D = U.segment(n, m),
          .covariance = covariance.block(n, n, m, m),
          .cov_U_D = covariance.block(0, n, n, m)};
}

/// Letters of the axes whose direction of travel is unknown: "Y, Z".
std::string axes_without_travel(const AxisTravel& travel) {
  std::string axes;
  for (const Axis axis : kAllAxes) {
    if (travel[index(axis)] == estimation::Travel::Unknown) {
      axes += message(axes.empty() ? "" : ", ", letter(axis));
    }
  }
  return axes;
}

}  // namespace

std::string label(const Backlash& b) {
  return b.position_m ? message(name(b.motion), " at ", *b.position_m, " m") : name(b.motion);
}

bool estimates_backlash(const Observations& o) {
  return o.basis.travel() != estimation::TravelDependence::None;
}

Result<std::size_t> first_with_known_travel(std::span<const AxisTravel> travel) {
  const auto is_known = [](const AxisTravel& t) { return axes_without_travel(t).empty(); };
  const auto found = std::find_if(travel.begin(), travel.end(), is_known);
  if (found == travel.end()) {
    return failure(ErrorCode::RankDeficient,
                   message("backlash: the path does not move ",
                           axes_without_travel(travel.empty() ? AxisTravel{} : travel.back()),
                           ": drive a path that moves all axes, or do not estimate backlash"));
  }
  return static_cast<std::size_t>(found - travel.begin());
}

std::string note_on_unused(const Observations& o) {
  const Result<std::size_t> first =
      estimates_backlash(o) ? first_with_known_travel(o.travel) : Result<std::size_t>(0);
  if (!first || *first == 0) {
    return {};
  }
  const char* const part = o.mode == Mode::Standstill ? "positions" : "legs";
  return message("the ", part, " before ", *first,
                 " are not used: ", axes_without_travel(o.travel[*first - 1]),
                 " had not moved yet, so the state of the backlash is unknown; begin "
                 "the path with a motion of all axes");
}

Result<std::size_t> first_with_backlash(Observations& o) {
  if (!estimates_backlash(o)) {
    return 0;
  }
  if (std::string unused = note_on_unused(o); !unused.empty()) {
    o.notes.push_back(std::move(unused));
  }
  return first_with_known_travel(o.travel);
}

estimation::Information with_backlash_prior(estimation::Information data, const Observations& o) {
  for (std::size_t i = o.layout().model_size(); i < o.basis.size(); ++i) {
    data.add_prior(i, 0.0, kUOfBacklash);
  }
  return data;
}

std::vector<Backlash> backlash_of(const Observations& o, const Eigen::VectorXd& U,
                                  const Eigen::MatrixXd& covariance) {
  if (!estimates_backlash(o)) {
    return {};
  }
  const TravelDifferences d = differences_in(o, U, covariance);
  return listed_differences(o.basis, d.D, d.covariance);
}

std::vector<Backlash> backlash_of(const VolumetricModel& model) {
  if (model.travel() == nullptr) {
    return {};
  }
  return listed_differences(*model.travel_tables(), model.travel()->D, model.travel()->covariance);
}

std::vector<Backlash> largest_of_tables(std::span<const Backlash> all) {
  std::vector<Backlash> largest;
  for (const Backlash& b : all) {
    if (!b.determined) {
      continue;
    }
    if (largest.empty() || largest.back().motion != b.motion) {
      largest.push_back(b);
    } else if (std::abs(b.value) > std::abs(largest.back().value)) {
      largest.back() = b;
    }
  }
  return largest;
}

std::vector<std::string> notes_on(std::span<const Backlash> all) {
  // Probability that noise alone exceeds it in one of 14 values: 1e-3.
  constexpr double kSure = 4.0;
  std::string found, undetermined;
  for (const Backlash& b : largest_of_tables(all)) {
    if (std::abs(b.value) > kSure * b.u) {
      found += message(found.empty() ? "" : ", ", label(b), " ", 1e6 * b.value,
                       is_rotation(b.motion.motion) ? " urad" : " um");
    }
  }
  for (const Backlash& b : all) {
    if (!b.determined) {
      undetermined += message(undetermined.empty() ? "" : ", ", label(b));
    }
  }

  std::vector<std::string> notes;
  if (!found.empty()) {
    notes.push_back(message("backlash, forward minus backward: ", found,
                            "; without the direction of travel the model is the mean of both, and "
                            "half the difference is in its uncertainty"));
  }
  if (!undetermined.empty()) {
    notes.push_back(message("backlash that the path does not determine, because an axis moves in ",
                            "one direction only or on too few legs: ", undetermined));
  }
  return notes;
}

Result<VolumetricModel> model_of(const Observations& o, std::span<const Vector3> tool_offsets_m,
                                 const Eigen::VectorXd& U, const Eigen::MatrixXd& covariance,
                                 ValidityVolume validity) {
  const auto n = static_cast<Eigen::Index>(o.layout().model_size());
  Eigen::MatrixXd of_tables = covariance.topLeftCorner(n, n);
  TravelDifferences differences;
  if (estimates_backlash(o)) {
    differences = differences_in(o, U, covariance);
    const Eigen::MatrixXd half = half_differences(o.basis, differences.D);
    of_tables += half * half.transpose();
  }

  Result<VolumetricModel> model = VolumetricModel::from_vector(
      o.basis, Gauge::G2, tool_offsets_m, U.head(n), of_tables, std::move(validity));
  if (!model || !estimates_backlash(o)) {
    return model;
  }
  return model->with_travel(std::move(differences));
}

}  // namespace abbe::calib::otf
