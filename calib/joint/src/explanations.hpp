#pragma once
/// What makes two contradicting parts agree (joint/identify.hpp).

#include "abbe/calib/internal/joint/pair_problem.hpp"
#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// Fills the explanations and tables of a test.
void explain(PairTest&, const PairProblem&, const Part& i, const Part& j, const DatumCoordinates&,
             const ParameterLayout&);

}  // namespace abbe::calib::joint
