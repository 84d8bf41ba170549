#include <algorithm>
#include <cmath>
#include <numeric>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/evemu/solve/artefact_rows.hpp"
#include "abbe/calib/internal/evemu/solve/pose_groups.hpp"
#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/joint/determining_rows.hpp"
#include "abbe/calib/internal/joint/left_out_rotations.hpp"
#include "abbe/calib/joint/part.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::joint {
namespace {

/// The unknowns of the part of an array, in this order: parameters, effects of the scales, left-out
/// rotations, errors of the array.
class ArrayUnknowns {
 public:
  ArrayUnknowns(const evemu::Observations& o, const CommonTables& common,
                const ArrayOptions& options)
      : common_(common), left_out_(common, o.machine.tool_offset_m - common.tool_offset_m) {
    const Eigen::MatrixX3d of_axis = axis_scale_columns(common.basis.layout());
    scales_.resize(of_axis.rows(), 0);
    for (const Axis a : kAllAxes) {
      if (const double u = options.effects.u_axis_scale[index(a)]; u > 0.0) {
        scales_.conservativeResize(Eigen::NoChange, scales_.cols() + 1);
        scales_.rightCols<1>() = u * of_axis.col(static_cast<Eigen::Index>(index(a)));
        effects_.push_back(message("scale of ", letter(a)));
        u_of_effects_.push_back(u);
      }
    }
    for (const evemu::ArtefactError& error : evemu::artefact_errors(o)) {
      effects_.push_back(error.name + " of " + options.array);
      u_of_effects_.push_back(error.u);
    }
  }

  [[nodiscard]] const CommonTables& common() const { return common_; }
  [[nodiscard]] std::size_t first_left_out() const {
    return common_.basis.size() + static_cast<std::size_t>(scales_.cols());
  }
  [[nodiscard]] std::size_t first_error() const { return first_left_out() + left_out_.size(); }
  [[nodiscard]] const std::vector<std::string>& effects() const { return effects_; }
  [[nodiscard]] const std::vector<double>& u_of_effects() const { return u_of_effects_; }

  [[nodiscard]] evemu::VolumetricDesign design(const Vector3& tool_offset_m) const {
    const evemu::VolumetricDesign of_tables =
        evemu::design_of(ModelBasis(common_.basis), tool_offset_m);
    return {first_error(), [this, of_tables](const Vector3& reading_m) {
              const Eigen::Matrix3Xd B = of_tables.B(reading_m);
              Eigen::Matrix3Xd all(3, static_cast<Eigen::Index>(first_error()));
              all << B, B * scales_, left_out_.B(reading_m);
              return all;
            }};
  }

 private:
  const CommonTables& common_;
  LeftOutRotations left_out_;
  Eigen::MatrixXd scales_;  ///< columns of the effects of the scales
  std::vector<std::string> effects_;
  std::vector<double> u_of_effects_;
};

std::vector<std::size_t> counted(std::size_t first, std::size_t end) {
  std::vector<std::size_t> all(end - first);
  std::iota(all.begin(), all.end(), first);
  return all;
}

/// Information of all groups about all unknowns, for the standard deviation s_m of a ball centre.
Result<estimation::Information> information_of_array(const evemu::Observations& o,
                                                     const ArrayUnknowns& unknowns, double s_m,
                                                     const Eigen::VectorXd& U) {
  evemu::PoseGroupOptions options{.s_m = s_m};
  const ModelBasis basis(unknowns.common().basis);
  if (U.size() > 0) {
    options.V_at_m = [&](const Vector3& reading_m) {
      return basis.V_m({.q_m = reading_m, .tool_offset_m = o.machine.tool_offset_m},
                       {U.data(), basis.size()});
    };
  }

  const auto groups = evemu::pose_groups(o, unknowns.design(o.machine.tool_offset_m), options);
  ABBE_TRY(groups);
  estimation::Information sum(groups->front().unknowns.size());
  for (const estimation::ObservationGroup& group : *groups) {
    ABBE_TRY(sum.add(group));
  }
  return sum;
}

struct ArrayNoise {
  double s_m = 0.0, dof = 0.0;
};
/// Estimates s from the residuals of an adjustment with s = `s_m` and the priors of the errors of
/// the array. The priors are necessary: a common scale of tables and array is not determined by any
/// data. Without priors it would multiply the noise of the readings in the design and thus
/// reproduce the residuals.
Result<ArrayNoise> residual_noise_of_array(estimation::Information with_s, std::size_t first_error,
                                           double s_m, double most_s_m) {
  constexpr double kLeastDof = 20.0;  // s then has an uncertainty of 16 %
  for (std::size_t k = first_error; k < with_s.unknowns(); ++k) {
    with_s.add_prior(k, 0.0, 1.0);
  }
  const DeterminingRows rows = determining_rows(with_s);
  const double dof = static_cast<double>(with_s.rows()) - static_cast<double>(rows.rank());
  if (dof < kLeastDof) {
    return failure(ErrorCode::TooFewObservations,
                   message(dof,
                           " degrees of freedom are left to estimate the noise of the ball "
                           "centres, needs ",
                           kLeastDof, ": state it, or touch more positions"));
  }

  const ArrayNoise noise{s_m * std::sqrt(rows.rest / dof), dof};
  if (noise.s_m > most_s_m) {
    return failure(ErrorCode::BadInput, message("the ball centres scatter by ", noise.s_m * kUmPerM,
                                                " um about the tables that fit them best, limit ",
                                                most_s_m * kUmPerM, " um"));
  }
  return noise;
}

evemu::Observations with_changed_errors(evemu::Observations o, const Matrix3& of_reading,
                                        const Matrix3& of_V) {
  // The touched points are removed: they belong to the readings as given. The changed observations
  // use ball centres.
  o.seen.clear();
  o.artefact.reset();
  for (evemu::BallError& row : o.rows) {
    row.reading_m = of_reading * row.reading_m;
    row.V_m = of_V * row.V_m;
  }
  return o;
}

std::vector<Vector3> readings_m(const evemu::Observations& o) {
  std::vector<Vector3> readings;
  for (const evemu::BallError& row : o.rows) {
    readings.push_back(row.reading_m);
  }
  return readings;
}

bool all_inside_travel(const evemu::Observations& o, const MachineNodes& nodes) {
  return outside_travel(readings_m(o), nodes).empty();
}

struct ChangedArray {
  std::string text;
  evemu::Observations observations;
};

/// Typical mistakes in files of ball errors: the axes of V, or of readings and V, are reversed or
/// swapped.
std::vector<ChangedArray> changed_axes(const evemu::Observations& o, const CommonTables& common) {
  std::vector<ChangedArray> changed;
  for (const AxisMistake& mistake : axis_mistakes()) {
    changed.push_back({"the errors have " + mistake.text,
                       with_changed_errors(o, Matrix3::Identity(), mistake.M)});
    evemu::Observations both = with_changed_errors(o, mistake.M, mistake.M);
    if (all_inside_travel(both, common.basis.layout().nodes())) {
      changed.push_back({"readings and errors have " + mistake.text, std::move(both)});
    }
  }

  return changed;
}

/// Observations with another stylus, for the hypothesis of a wrong tool offset.
std::vector<ChangedArray> changed_tools(const evemu::Observations& o, const CommonTables& common) {
  std::vector<ChangedArray> changed;
  const Vector3& t = o.machine.tool_offset_m;
  for (const Vector3& other : {Vector3(-t), Vector3(Vector3::Zero()), common.tool_offset_m}) {
    if ((other - t).norm() > VolumetricModel::kToolTolerance_m) {
      evemu::Observations with_tool = o;
      with_tool.machine.tool_offset_m = other;
      changed.push_back({message("the tool offset is ", mm_text(other), ", not ", mm_text(t)),
                         std::move(with_tool)});
    }
  }
  return changed;
}

/// The stated noise of a ball centre, or an estimate from the residuals if none is stated.
Result<ArrayNoise> noise_of_array(const evemu::Observations& o, const CommonTables& common,
                                  const ArrayOptions& options) {
  if (options.s_m > 0.0) {
    return ArrayNoise{options.s_m, 0.0};
  }
  const ArrayUnknowns unknowns(o, common, options);
  constexpr int kRepeats = 3;  // s depends on the errors of the array, and their separation depends
                               // on s
  ArrayNoise noise{1e-6, 0.0};
  for (int i = 0; i < kRepeats; ++i) {
    Result<ArrayNoise> next =
        information_of_array(o, unknowns, noise.s_m, options.linearised_at)
            .and_then([&](const estimation::Information& information) {
              return residual_noise_of_array(information, unknowns.first_error(), noise.s_m,
                                             options.most_s_m);
            });
    if (!next) {
      return next;
    }
    noise = *next;
  }
  return noise;
}

/// The information of a part about parameters, effects of the scales and errors of the array; the
/// left-out rotations may have any value.
Result<Part> array_part(const evemu::Observations& o, const CommonTables& common,
                        const ArrayOptions& options, const ArrayNoise& noise) {
  const ArrayUnknowns unknowns(o, common, options);
  Result<estimation::Information> all =
      information_of_array(o, unknowns, noise.s_m, options.linearised_at);
  ABBE_TRY(all);
  if (unknowns.first_error() > unknowns.first_left_out()) {
    all = all->without_unknowns(counted(unknowns.first_left_out(), unknowns.first_error()));
  }
  return Part{.method = "evemu",
              .information = *std::move(all),
              .effects = unknowns.effects(),
              .u_of_effects = unknowns.u_of_effects(),
              .dof_of_noise = noise.dof};
}

/// The information extended by columns of zeros at the end, for effects that it does not contain.
estimation::Information with_all_effects(const estimation::Information& some,
                                         std::size_t unknowns) {
  estimation::Information all(unknowns);
  all.add(some, counted(0, some.unknowns()));
  return all;
}

/// Adds hypotheses about mistakes; `given` are the observations without a mistake in the same form.
/// All get the noise of the hypothesis that fits best. With a noise of its own, a wrong hypothesis
/// would explain its own residuals.
void add_mistakes(std::vector<Mistake>& mistakes, const evemu::Observations& given,
                  std::vector<ChangedArray> changed, const CommonTables& common,
                  const ArrayOptions& options, std::size_t unknowns) {
  Result<ArrayNoise> noise = noise_of_array(given, common, options);
  std::vector<ChangedArray> possible;
  for (ChangedArray& of : changed) {
    if (const Result<ArrayNoise> own = noise_of_array(of.observations, common, options)) {
      noise = !noise || own->s_m < noise->s_m ? own : noise;
      possible.push_back(std::move(of));
    }
  }

  if (!noise) {
    return;
  }

  const auto information = [&](const evemu::Observations& o) {
    return array_part(o, common, options, *noise).map([&](const Part& part) {
      return with_all_effects(part.information, unknowns);
    });
  };
  const auto as_given = information(given);
  for (ChangedArray& of : possible) {
    if (auto changed_information = information(of.observations); changed_information && as_given) {
      mistakes.push_back({std::move(of.text), *std::move(changed_information), *as_given});
    }
  }
}

std::vector<Mistake> mistakes_of_array(const evemu::Observations& o, const CommonTables& common,
                                       const ArrayOptions& options, std::size_t unknowns) {
  std::vector<Mistake> mistakes;
  add_mistakes(mistakes, with_changed_errors(o, Matrix3::Identity(), Matrix3::Identity()),
               changed_axes(o, common), common, options, unknowns);
  add_mistakes(mistakes, o, changed_tools(o, common), common, options, unknowns);
  return mistakes;
}

/// Text such as "; not if the errors have Y reversed": the mistakes whose correction makes the
/// noise small enough.
std::string mistakes_text(const evemu::Observations& o, const CommonTables& common,
                          const ArrayOptions& options) {
  std::vector<std::string> without;
  for (const auto& changed : {changed_axes(o, common), changed_tools(o, common)}) {
    for (const ChangedArray& of : changed) {
      if (noise_of_array(of.observations, common, options)) {
        without.push_back(of.text);
      }
    }
  }
  return without.empty() ? "" : "; not if " + or_list(without);
}

Result<void> check_array(const evemu::Observations& o, const CommonTables& common) {
  if (o.machine.chain.order_w_to_t() != common.basis.layout().chain().order_w_to_t()) {
    return failure(ErrorCode::NotApplicable,
                   message("the array was touched with the axes ", o.machine.chain.text(),
                           ", the common tables have ", common.basis.layout().chain().text()));
  }
  if (o.rows.empty()) {
    return failure(ErrorCode::TooFewObservations, "there are no ball errors");
  }

  const MachineNodes& nodes = common.basis.layout().nodes();
  const std::vector<Vector3> readings = readings_m(o);
  if (const std::vector<OutsideTravel> outside = outside_travel(readings, nodes);
      !outside.empty()) {
    const auto [point, axis] = outside.front();
    const std::vector<double>& nodes_m = nodes[axis].nodes_m;
    return failure(ErrorCode::BadInput,
                   message("ball ", o.rows[point].ball, " at position ", o.rows[point].position,
                           " has the reading ", letter(kAllAxes[axis]), " = ",
                           kMmPerM * readings[point](static_cast<Eigen::Index>(axis)),
                           " mm, the nodes of the common tables reach from ",
                           kMmPerM * nodes_m.front(), " to ", kMmPerM * nodes_m.back(),
                           " mm: leave the ball out, or identify tables that contain it",
                           corrections_inside_travel(readings, nodes)));
  }
  return {};
}

}  // namespace

Result<Part> part_of_array(std::string name, const evemu::Observations& o,
                           const CommonTables& common, const ArrayOptions& options) {
  const auto in_this_part = [&](const Error& e) {
    return Error{e.code, message("joint identification: ", name, ": ", e.text)};
  };
  if (Result<void> valid = check_array(o, common); !valid) {
    return tl::unexpected(in_this_part(valid.error()));
  }

  Result<Part> part = noise_of_array(o, common, options).and_then([&](const ArrayNoise& noise) {
    return array_part(o, common, options, noise);
  });
  if (!part) {
    Error error = in_this_part(part.error());
    if (error.code == ErrorCode::BadInput && !(options.s_m > 0.0)) {
      error.text += mistakes_text(o, common, options);
    }
    return tl::unexpected(std::move(error));
  }

  part->covered_m = readings_m(o);
  part->name = std::move(name);
  part->mistakes = [o, common, options, unknowns = part->information.unknowns()] {
    return mistakes_of_array(o, common, options, unknowns);
  };
  return part;
}

}  // namespace abbe::calib::joint
