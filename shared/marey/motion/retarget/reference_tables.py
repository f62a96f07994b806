"""Joints of the reference skeletons: name, parent, place of the rest pose in metres (Y up, +Z forward), and where the
joint's axes do not follow the bone to the first child, the direction that they follow.

`<Left>` and `<l>` stand for both sides; the right side mirrors the left one. `=NAME` copies place and axes of a joint.
"""

MIXAMO = """
mixamorig:Hips              -                           0 0.975 0
mixamorig:Spine             mixamorig:Hips              0 1.07 0
mixamorig:Spine1            mixamorig:Spine             0 1.175 -0.0157
mixamorig:Spine2            mixamorig:Spine1            0 1.29 -0.0328
mixamorig:Neck              mixamorig:Spine2            0 1.45 -0.0525 0 0.993 -0.122
mixamorig:Head              mixamorig:Neck              0 1.545 -0.035 0 0.993 -0.122
mixamorig:HeadTop_End       mixamorig:Head              0 1.74 0.01 0 0.993 -0.122
mixamorig:<Left>Shoulder    mixamorig:Spine2            0.05 1.409 -0.03 0.977 -0.04 -0.21
mixamorig:<Left>Arm         mixamorig:<Left>Shoulder    0.18 1.405 -0.0525
mixamorig:<Left>ForeArm     mixamorig:<Left>Arm         0.45 1.405 -0.0525
mixamorig:<Left>Hand        mixamorig:<Left>ForeArm     0.7 1.405 -0.0525 1 0 0
mixamorig:<Left>HandThumb1  mixamorig:<Left>Hand        0.725 1.395 -0.0285
mixamorig:<Left>HandThumb2  mixamorig:<Left>HandThumb1  0.757 1.376 -0.0085
mixamorig:<Left>HandThumb3  mixamorig:<Left>HandThumb2  0.783 1.361 0.0085
mixamorig:<Left>HandThumb4  mixamorig:<Left>HandThumb3  0.806 1.348 0.0235
mixamorig:<Left>HandIndex1  mixamorig:<Left>Hand        0.795 1.405 -0.0305
mixamorig:<Left>HandIndex2  mixamorig:<Left>HandIndex1  0.831 1.405 -0.0305
mixamorig:<Left>HandIndex3  mixamorig:<Left>HandIndex2  0.861 1.405 -0.0305
mixamorig:<Left>HandIndex4  mixamorig:<Left>HandIndex3  0.888 1.405 -0.0305
mixamorig:<Left>HandMiddle1 mixamorig:<Left>Hand        0.8 1.405 -0.0525
mixamorig:<Left>HandMiddle2 mixamorig:<Left>HandMiddle1 0.838 1.405 -0.0525
mixamorig:<Left>HandMiddle3 mixamorig:<Left>HandMiddle2 0.869 1.405 -0.0525
mixamorig:<Left>HandMiddle4 mixamorig:<Left>HandMiddle3 0.897 1.405 -0.0525
mixamorig:<Left>HandRing1   mixamorig:<Left>Hand        0.793 1.405 -0.0725
mixamorig:<Left>HandRing2   mixamorig:<Left>HandRing1   0.829 1.405 -0.0725
mixamorig:<Left>HandRing3   mixamorig:<Left>HandRing2   0.859 1.405 -0.0725
mixamorig:<Left>HandRing4   mixamorig:<Left>HandRing3   0.886 1.405 -0.0725
mixamorig:<Left>HandPinky1  mixamorig:<Left>Hand        0.783 1.403 -0.0925
mixamorig:<Left>HandPinky2  mixamorig:<Left>HandPinky1  0.813 1.403 -0.0925
mixamorig:<Left>HandPinky3  mixamorig:<Left>HandPinky2  0.837 1.403 -0.0925
mixamorig:<Left>HandPinky4  mixamorig:<Left>HandPinky3  0.86 1.403 -0.0925
mixamorig:<Left>UpLeg       mixamorig:Hips              0.085 0.92 0
mixamorig:<Left>Leg         mixamorig:<Left>UpLeg       0.085 0.505 0
mixamorig:<Left>Foot        mixamorig:<Left>Leg         0.085 0.09 -0.029
mixamorig:<Left>ToeBase     mixamorig:<Left>Foot        0.085 0 0.0825
mixamorig:<Left>Toe_End     mixamorig:<Left>ToeBase     0.085 0 0.165
"""

HUMANIK = """
Reference         -                 0 0 0
Hips              Reference         0 0.97 0
Spine             Hips              0 1.055 0
Spine1            Spine             0 1.145 0
Spine2            Spine1            0 1.235 0
Spine3            Spine2            0 1.325 0
Neck              Spine3            0 1.45 0
Head              Neck              0 1.555 0.015
<Left>Shoulder    Spine3            0.06 1.4 0
<Left>Arm         <Left>Shoulder    0.18 1.405 0
<Left>ArmRoll     <Left>Arm         0.315 1.405 0
<Left>ForeArm     <Left>Arm         0.45 1.405 0
<Left>ForeArmRoll <Left>ForeArm     0.575 1.405 0
<Left>Hand        <Left>ForeArm     0.7 1.405 0
<Left>HandThumb1  <Left>Hand        0.725 1.395 0.024
<Left>HandThumb2  <Left>HandThumb1  0.757 1.376 0.044
<Left>HandThumb3  <Left>HandThumb2  0.783 1.361 0.061
<Left>HandThumb4  <Left>HandThumb3  0.806 1.348 0.076
<Left>HandIndex1  <Left>Hand        0.795 1.405 0.022
<Left>HandIndex2  <Left>HandIndex1  0.831 1.405 0.022
<Left>HandIndex3  <Left>HandIndex2  0.861 1.405 0.022
<Left>HandIndex4  <Left>HandIndex3  0.888 1.405 0.022
<Left>HandMiddle1 <Left>Hand        0.8 1.405 0
<Left>HandMiddle2 <Left>HandMiddle1 0.838 1.405 0
<Left>HandMiddle3 <Left>HandMiddle2 0.869 1.405 0
<Left>HandMiddle4 <Left>HandMiddle3 0.897 1.405 0
<Left>HandRing1   <Left>Hand        0.793 1.405 -0.02
<Left>HandRing2   <Left>HandRing1   0.829 1.405 -0.02
<Left>HandRing3   <Left>HandRing2   0.859 1.405 -0.02
<Left>HandRing4   <Left>HandRing3   0.886 1.405 -0.02
<Left>HandPinky1  <Left>Hand        0.783 1.403 -0.04
<Left>HandPinky2  <Left>HandPinky1  0.813 1.403 -0.04
<Left>HandPinky3  <Left>HandPinky2  0.837 1.403 -0.04
<Left>HandPinky4  <Left>HandPinky3  0.86 1.403 -0.04
<Left>UpLeg       Hips              0.085 0.915 0
<Left>UpLegRoll   <Left>UpLeg       0.085 0.7125 0
<Left>Leg         <Left>UpLeg       0.085 0.51 0
<Left>LegRoll     <Left>Leg         0.085 0.3 -0.01
<Left>Foot        <Left>Leg         0.085 0.09 -0.02
<Left>ToeBase     <Left>Foot        0.085 0.015 0.115
"""

UE4 = """
root                  -             0 0 0
pelvis                root          0 0.975 0
spine_01              pelvis        0 1.07 0
spine_02              spine_01      0 1.2 0.012
spine_03              spine_02      0 1.325 -0.004
neck_01               spine_03      0 1.475 -0.025
head                  neck_01       0 1.57 0 0 1 0.15
clavicle_<l>          spine_03      0.04 1.43 0
upperarm_<l>          clavicle_<l>  0.18 1.425 0
upperarm_twist_01_<l> upperarm_<l>  0.1874 1.418 0
lowerarm_<l>          upperarm_<l>  0.3806 1.244 0
lowerarm_twist_01_<l> lowerarm_<l>  0.4763 1.158 0.01809
hand_<l>              lowerarm_<l>  0.5646 1.079 0.03479 0.07359 -0.06626 0.01392
thumb_01_<l>          hand_<l>      0.5763 1.055 0.06227
thumb_02_<l>          thumb_01_<l>  0.5872 1.019 0.08673
thumb_03_<l>          thumb_02_<l>  0.5963 0.991 0.1073
index_01_<l>          hand_<l>      0.6345 1.016 0.07001
index_02_<l>          index_01_<l>  0.661 0.9919 0.07502
index_03_<l>          index_02_<l>  0.6831 0.972 0.0792
middle_01_<l>         hand_<l>      0.6382 1.012 0.04871
middle_02_<l>         middle_01_<l> 0.6662 0.9872 0.054
middle_03_<l>         middle_02_<l> 0.689 0.9667 0.05831
ring_01_<l>           hand_<l>      0.6331 1.017 0.02774
ring_02_<l>           ring_01_<l>   0.6596 0.9932 0.03275
ring_03_<l>           ring_02_<l>   0.6816 0.9733 0.03692
pinky_01_<l>          hand_<l>      0.6244 1.022 0.006345
pinky_02_<l>          pinky_01_<l>  0.6464 1.002 0.01052
pinky_03_<l>          pinky_02_<l>  0.6641 0.9864 0.01386
thigh_<l>             pelvis        0.09 0.955 0.005
thigh_twist_01_<l>    thigh_<l>     0.0975 0.735 0.0075
calf_<l>              thigh_<l>     0.105 0.515 0.01
calf_twist_01_<l>     calf_<l>      0.115 0.3 -0.01
foot_<l>              calf_<l>      0.125 0.095 -0.03 0 -1 0
ball_<l>              foot_<l>      0.13 0.015 0.13 0 0 1
ik_foot_root          root          0 0 0
ik_foot_<l>           ik_foot_root  =foot_<l>
ik_hand_root          root          0 0 0
ik_hand_gun           ik_hand_root  =hand_r
ik_hand_l             ik_hand_gun   =hand_l
ik_hand_r             ik_hand_gun   =hand_r
"""
