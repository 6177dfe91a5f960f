# Bodies for the tests of sonde fit, in mm: a skin, sites on it and forces that stiffen.
# awk -v kind=forearm|dome|leg -v dir=DIR -f bodies.awk writes DIR/skin.ply, sites.csv and ind.csv.
# forearm: a bent, tapered tube; leg: a long one that leaves any straight axis; dome: half an
# ellipsoid on a flat base.
function site_row(id,x,y,z,nx,ny,nz,ux,uy,uz,vx,vy,vz){ printf "%d,%.5f,%.5f,%.5f,%.7f,%.7f,%.7f,%.7f,%.7f,%.7f,%.7f,%.7f,%.7f\n",id,x,y,z,nx,ny,nz,ux,uy,uz,vx,vy,vz > (dir "/sites.csv");
  for(p=0;p<2;p++){ nm=p?"point":"linear"; k=p?0.085:0.43; for(d=2;d<=14;d+=2) printf "%d,%s,%.5f,%.5f,%.5f,%.7f,%.7f,%.7f,%g,%.4f\n",id,nm,x,y,z,nx,ny,nz,d,k*d/(1-(d/30)^2) > (dir "/ind.csv") } }
BEGIN{
 pi=atan2(0,-1); nv=0; nf=0;
 print "site,x_mm,y_mm,z_mm,nx,ny,nz,ux,uy,uz,vx,vy,vz" > (dir "/sites.csv");
 print "site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n" > (dir "/ind.csv");
 if(kind=="dome"){
  N=64; M=16; R=65; H=45;
  # apex
  V[nv++]="0 0 " H;
  for(i=1;i<=M;i++){ t=i*pi/2/M; for(j=0;j<N;j++){a=2*pi*j/N; V[nv++]=sprintf("%.5f %.5f %.5f",R*sin(t)*cos(a),R*sin(t)*sin(a),H*cos(t))} }
  base=nv; V[nv++]="0 0 0";
  for(j=0;j<N;j++){F[nf++]="3 0 " 1+j " " 1+(j+1)%N; }
  for(i=1;i<M;i++)for(j=0;j<N;j++){a=1+(i-1)*N+j;b=1+(i-1)*N+(j+1)%N;c=a+N;d=b+N;F[nf++]="3 " a " " c " " b;F[nf++]="3 " b " " c " " d}
  for(j=0;j<N;j++){a=1+(M-1)*N+j;b=1+(M-1)*N+(j+1)%N;F[nf++]="3 " a " " base " " b}
  id=0; for(i=3;i<=9;i+=3)for(j=0;j<4;j++){t=i*pi/2/M;a=2*pi*j/4+0.3; x=R*sin(t)*cos(a);y=R*sin(t)*sin(a);z=H*cos(t); nx=sin(t)*cos(a)/R;ny=sin(t)*sin(a)/R;nz=cos(t)/H;l=sqrt(nx^2+ny^2+nz^2);nx/=l;ny/=l;nz/=l; ux=-sin(a);uy=cos(a);uz=0; vx=ny*uz-nz*uy;vy=nz*ux-nx*uz;vz=nx*uy-ny*ux; site_row(id++,x,y,z,nx,ny,nz,ux,uy,uz,vx,vy,vz)}
 } else {
  N=48; L=kind=="leg"?700:260; M=int(L/6); bend=kind=="leg"?150:15;
  for(i=0;i<=M;i++){ s=i/M; z=L*s; cx=bend*s*s; r=kind=="leg"?75-45*s:45-15*s; for(j=0;j<N;j++){a=2*pi*j/N; V[nv++]=sprintf("%.5f %.5f %.5f",cx+r*cos(a),0.9*r*sin(a),z)} }
  lo=nv; V[nv++]="0 0 0"; hi=nv; V[nv++]=sprintf("%.5f 0 %.5f",bend,L);
  for(i=0;i<M;i++)for(j=0;j<N;j++){a=i*N+j;b=i*N+(j+1)%N;c=a+N;d=b+N;F[nf++]="3 " a " " b " " c;F[nf++]="3 " b " " d " " c}
  for(j=0;j<N;j++){a=j;b=(j+1)%N;F[nf++]="3 " b " " a " " lo; a=M*N+j;b=M*N+(j+1)%N;F[nf++]="3 " a " " b " " hi}
  id=0; for(i=0;i<4;i++)for(j=0;j<3;j++){ z=kind=="leg"?100+40*i:70+40*i; s=z/L; cx=bend*s*s; r=kind=="leg"?75-45*s:45-15*s; a=(j-1)*0.35+1.2; nx=cos(a);ny=sin(a)/0.9;l=sqrt(nx^2+ny^2);nx/=l;ny/=l;nz=0; ux=-ny;uy=nx;uz=0; site_row(id++,cx+r*cos(a),0.9*r*sin(a),z,nx,ny,0,ux,uy,0,0,0,1)}
 }
 f=dir "/skin.ply"; printf "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n",nv,nf > f;
 for(i=0;i<nv;i++)print V[i] > f; for(i=0;i<nf;i++)print F[i] > f;
}
