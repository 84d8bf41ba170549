#pragma once
/// Explanations of a contradiction between two parts (joint/identify.hpp).

#include "abbe/calib/internal/joint/pair_problem.hpp"
#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// Finds hypotheses under which two contradicting parts agree (joint/identify.hpp). Fills the
/// explanations and tables of the test.
void explain(PairTest&, const PairProblem&, const Part& i, const Part& j, const DatumCoordinates&,
             const ParameterLayout&);

}  // namespace abbe::calib::joint
