#include <gtest/gtest.h>
#include <cstdio>
#include "vdbgeo/measure/analytic_patches.h"
#include "vdbgeo/measure/discrete_curvature.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/field_curvature.h"
using namespace vdbgeo;
TEST(X,Y){
 for (double jit:{0.,.2}) for(int s=0;s<9;s++) { std::vector<CurvatureErrors> prev;
  for(double h:{.1,.05,.025,.0125}){ AnalyticPatchOptions o; o.shape=PatchShape(s); o.max_edge=h; o.jitter=jit; auto a=analytic_patch(o);
   std::vector<std::pair<const char*,CurvatureErrors>> e;
   e.push_back({"ring",curvature_errors(a,discrete_curvature(a.mesh,{DualArea::voronoi}))});
   JetOptions j; j.degree=2;j.rings=2; e.push_back({"jet2,2",curvature_errors(a,jet_curvature(a.mesh,j))});
   j.degree=3;j.rings=2; e.push_back({"jet3,2",curvature_errors(a,jet_curvature(a.mesh,j))});
   j.degree=3;j.rings=3; e.push_back({"jet3,3",curvature_errors(a,jet_curvature(a.mesh,j))});
   j.degree=4;j.rings=3; e.push_back({"jet4,3",curvature_errors(a,jet_curvature(a.mesh,j))});
   auto m=patch_map(o.shape,h,o.radius); FieldCurvatureOptions f; auto fc=field_curvature(a.mesh,m,f);
   e.push_back({"field",curvature_errors(a,fc)});
   f.scale=1; e.push_back({"field1",curvature_errors(a,field_curvature(a.mesh,m,f))});
   for(size_t k=0;k<e.size();k++){ auto c=e[k].second; printf("%-14s j %.1f %.4f %-7s",name_of(o.shape),jit,h,e[k].first); double v[4]={c.K_max,c.K_rms,c.H_max,c.H_rms},p[4]={}; if(!prev.empty()){auto q=prev[k]; p[0]=q.K_max;p[1]=q.K_rms;p[2]=q.H_max;p[3]=q.H_rms;}
    for(int i=0;i<4;i++) printf(" %.2e(%5.2f)",v[i],p[i]>0?log2(p[i]/v[i]):0.); if(k==5) printf(" scale %g",fc.scale); printf("\n"); }
   prev.clear(); for(auto&x:e) prev.push_back(x.second); } } }
